//! The file of a fault plan, and its validation into a [`FaultPlan`].
//!
//! ```toml
//! description = "the tracker freezes, later the amplifiers lag"
//!
//! [[faults]]
//! at_s = 5.0                 # since the driver's start
//! for_s = 0.4                # or lasting = true
//! target = "poses"
//! verb = "stuck"
//! magnet = "m2"              # left out: all of the target
//!
//! [[faults]]
//! at_s = 9.0
//! lasting = true
//! target = "actuators"
//! verb = "delayed"
//! delay_ms = 80.0
//! ```

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::description::HardwareDescription;
use crate::invalid::{Checks, Invalid};

use super::checked::{Fault, FaultRefusal};
use super::kinds::{Condition, EpochChange, FaultTarget, FaultVerb, Garbage, Part, Reach, TIME_MAX};
use super::plan::{FaultPlan, Scheduled};
use super::slots::FAULTS_MAX;

/// A fault plan as its file has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultPlanConfig {
    /// What the plan is for, for people.
    pub description: String,
    /// `[[faults]]`, at most 32 a target.
    pub faults: Vec<FaultConfig>,
}

/// One of `[[faults]]`. A parameter stands where the verb needs it, and nowhere else.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultConfig {
    /// When it begins, s since the driver's start, 0 to a week.
    pub at_s: f64,
    /// How long it lasts, s, above 0, to a week; or `lasting`.
    pub for_s: Option<f64>,
    /// True in place of `for_s`: until the driver ends or the fault is cleared.
    pub lasting: Option<bool>,
    /// What it befalls.
    pub target: FaultTarget,
    /// What it does.
    pub verb: VerbName,
    /// Name of the one magnet of `poses`; left out for all.
    pub magnet: Option<String>,
    /// Name of the one coil of `feedback` or `actuators`, or of the target `coil`.
    pub coil: Option<String>,
    /// Name of the one frame, likewise.
    pub frame: Option<String>,
    /// Kind of `garbage`: `nan`, `huge`, `quaternion` or `random`.
    pub garbage: Option<Garbage>,
    /// Of `slow`, Hz, 0.1 to 1000: messages a second; for actuators, corner frequency of the lag.
    pub rate_hz: Option<f64>,
    /// Of `delayed`, ms, 1 to 1000.
    pub delay_ms: Option<f64>,
    /// Of `intermittent`, ms, 2 to 60000.
    pub period_ms: Option<f64>,
    /// Share of the period in which `intermittent` is off, above 0 and below 1.
    pub off_fraction: Option<f64>,
    /// How `wrong-epoch` is wrong: `other` or `every-message`.
    pub epoch: Option<EpochChange>,
    /// Share of the turns that are `shorted`, above 0, at most 0.9.
    pub turns_fraction: Option<f64>,
}

/// Names of the verbs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[expect(missing_docs, reason = "each is the verb of the same name, without its parameters")]
pub enum VerbName {
    Off,
    Stuck,
    Garbage,
    Slow,
    Delayed,
    Intermittent,
    Repeated,
    Backward,
    WrongEpoch,
    WrongVersion,
    Open,
    Shorted,
    StuckAmplifier,
    Stalled,
}

impl FaultPlanConfig {
    /// Validates every fault for the rig of `description` and a driver whose faults go as deep as `reach`.
    ///
    /// # Errors
    /// Every value that is out of its range, missing, superfluous or makes no sense.
    pub fn build(&self, description: &HardwareDescription, reach: Reach) -> Result<FaultPlan, Vec<Invalid>> {
        let mut checks = Checks::new();
        checks.require(!self.faults.is_empty(), "faults", "empty", "at least one fault");
        let mut scheduled = Vec::new();
        for (index, fault) in self.faults.iter().enumerate() {
            let key = format!("faults[{index}].");
            scheduled.extend(fault.build(&key, description, reach, &mut checks));
        }
        for target in FaultTarget::ALL {
            let count = self.faults.iter().filter(|fault| fault.target == target).count();
            let (value, expected) =
                (format!("{count} of {target}"), format!("at most {FAULTS_MAX} of a target"));
            checks.require(count <= FAULTS_MAX, "faults", value, expected);
        }
        checks.into_result(FaultPlan::new(reach, scheduled))
    }
}

impl FaultConfig {
    /// A fault that begins at once, with no parameters yet; for `for_s` absent it lasts.
    #[must_use]
    pub const fn immediate(target: FaultTarget, verb: VerbName, for_s: Option<f64>) -> Self {
        Self {
            at_s: 0.0,
            for_s,
            lasting: if for_s.is_none() { Some(true) } else { None },
            target,
            verb,
            magnet: None,
            coil: None,
            frame: None,
            garbage: None,
            rate_hz: None,
            delay_ms: None,
            period_ms: None,
            off_fraction: None,
            epoch: None,
            turns_fraction: None,
        }
    }

    /// The fault with its times, when everything fits; else `checks` has why not, under keys that start with
    /// `key`.
    pub fn build(
        &self,
        key: &str,
        description: &HardwareDescription,
        reach: Reach,
        checks: &mut Checks,
    ) -> Option<Scheduled> {
        let from = self.start(key, checks);
        let lasts = self.duration(key, checks);
        self.check_presence(key, checks);
        let part = self.part(key, description, checks);
        let verb = self.verb(key, checks)?;
        let fault = match Fault::new(self.target, part?, verb, description, reach) {
            Ok(fault) => fault,
            Err(refusal) => {
                self.refuse(key, &refusal, checks);
                return None;
            }
        };
        Some(Scheduled { fault, from: from?, lasts: lasts? })
    }

    fn start(&self, key: &str, checks: &mut Checks) -> Option<Duration> {
        let holds = self.at_s.is_finite() && (0.0..=TIME_MAX.as_secs_f64()).contains(&self.at_s);
        let expected = format!("from 0 to {} (a week)", TIME_MAX.as_secs());
        checks.require(holds, format!("{key}at_s"), self.at_s, expected);
        holds.then(|| Duration::from_secs_f64(self.at_s))
    }

    fn duration(&self, key: &str, checks: &mut Checks) -> Option<Option<Duration>> {
        match (self.for_s, self.lasting) {
            (Some(for_s), None) => {
                let holds = for_s > 0.0 && for_s <= TIME_MAX.as_secs_f64();
                let expected = format!("above 0, at most {} (a week)", TIME_MAX.as_secs());
                checks.require(holds, format!("{key}for_s"), for_s, expected);
                holds.then(|| Some(Duration::from_secs_f64(for_s)))
            }
            (None, Some(lasting)) => {
                checks.require(lasting, format!("{key}lasting"), lasting, "true, or for_s in its place");
                lasting.then_some(None)
            }
            (Some(_), Some(lasting)) => {
                checks.require(false, format!("{key}lasting"), lasting, "left out where for_s is given");
                None
            }
            (None, None) => {
                checks.require(false, format!("{key}for_s"), "missing", "a time in s, or lasting = true");
                None
            }
        }
    }

    /// Each parameter stands where its verb needs it, and nowhere else.
    fn check_presence(&self, key: &str, checks: &mut Checks) {
        let name = self.verb.name();
        let given = [
            ("garbage", self.garbage.is_some(), VerbName::Garbage),
            ("rate_hz", self.rate_hz.is_some(), VerbName::Slow),
            ("delay_ms", self.delay_ms.is_some(), VerbName::Delayed),
            ("period_ms", self.period_ms.is_some(), VerbName::Intermittent),
            ("off_fraction", self.off_fraction.is_some(), VerbName::Intermittent),
            ("epoch", self.epoch.is_some(), VerbName::WrongEpoch),
            ("turns_fraction", self.turns_fraction.is_some(), VerbName::Shorted),
        ];
        for (parameter, is_given, verb) in given {
            if is_given != (verb == self.verb) {
                let (value, expected) = if is_given {
                    ("given", format!("left out: verb {name} has none"))
                } else {
                    ("missing", format!("given: verb {name} needs it"))
                };
                checks.require(false, format!("{key}{parameter}"), value, expected);
            }
        }
    }

    /// The part, `Some(None)` for all of the target; `None` when a name was refused.
    fn part(
        &self,
        key: &str,
        description: &HardwareDescription,
        checks: &mut Checks,
    ) -> Option<Option<Part>> {
        let magnets: Vec<&str> = description.magnets().map(|magnet| magnet.name.as_str()).collect();
        let coils: Vec<&str> = description.coils.iter().map(|coil| coil.name.as_str()).collect();
        let frames: Vec<&str> = description.frames.iter().map(|frame| frame.name.as_str()).collect();
        let kinds = [
            ("magnet", &self.magnet, magnets, Part::Magnet as fn(usize) -> Part),
            ("coil", &self.coil, coils, Part::Coil),
            ("frame", &self.frame, frames, Part::Frame),
        ];
        let mut part = None;
        for (kind, name, names, make) in kinds {
            let Some(name) = name else { continue };
            let found = names.iter().position(|known| known == name);
            let expected = format!("the name of a {kind} of the rig ({})", names.join(", "));
            checks.require(found.is_some(), format!("{key}{kind}"), format!("{name:?}"), expected);
            checks.require(part.is_none(), format!("{key}{kind}"), name, "left out: one part alone");
            part = Some(make(found?));
        }
        Some(part)
    }

    /// The verb with its parameters; `None` when one is missing.
    fn verb(&self, key: &str, checks: &mut Checks) -> Option<FaultVerb> {
        let mut milliseconds = |parameter: &str, value: f64| {
            let duration = Duration::try_from_secs_f64(value * 1e-3).ok();
            checks.require(duration.is_some(), format!("{key}{parameter}"), value, "a finite time >= 0");
            duration
        };
        Some(match self.verb {
            VerbName::Off => FaultVerb::Off,
            VerbName::Stuck => FaultVerb::Stuck,
            VerbName::Garbage => FaultVerb::Garbage(self.garbage?),
            VerbName::Slow => FaultVerb::Slow { rate_hz: self.rate_hz? },
            VerbName::Delayed => FaultVerb::Delayed { by: milliseconds("delay_ms", self.delay_ms?)? },
            VerbName::Intermittent => FaultVerb::Intermittent {
                period: milliseconds("period_ms", self.period_ms?)?,
                off_fraction: self.off_fraction?,
            },
            VerbName::Repeated => FaultVerb::Repeated,
            VerbName::Backward => FaultVerb::Backward,
            VerbName::WrongEpoch => FaultVerb::WrongEpoch(self.epoch?),
            VerbName::WrongVersion => FaultVerb::WrongVersion,
            VerbName::Open => FaultVerb::Physical(Condition::Open),
            VerbName::Shorted => FaultVerb::Physical(Condition::Shorted { fraction: self.turns_fraction? }),
            VerbName::StuckAmplifier => FaultVerb::Physical(Condition::StuckAmplifier),
            VerbName::Stalled => FaultVerb::Physical(Condition::Stalled),
        })
    }

    /// Names the key that a refusal is about.
    fn refuse(&self, key: &str, refusal: &FaultRefusal, checks: &mut Checks) {
        let verb = self.verb.name();
        let target = self.target;
        let (last, value, expected) = match refusal {
            FaultRefusal::NotApplicable { .. } => {
                let expected = format!("one that applies to {target}: {}", super::kinds::verbs_of(target));
                ("verb", verb.to_owned(), expected)
            }
            FaultRefusal::UnsafeGarbage | FaultRefusal::NoQuaternion => {
                let kind = self.garbage.map_or("missing", Garbage::name);
                ("garbage", kind.to_owned(), format!("another kind: {refusal}"))
            }
            FaultRefusal::PartKind { part, .. } => {
                (*part, "given".to_owned(), format!("left out: {refusal}"))
            }
            FaultRefusal::PartMissing { .. } => {
                (target.name(), "missing".to_owned(), format!("given: {refusal}"))
            }
            FaultRefusal::Range { parameter, value, expected } => {
                (*parameter, value.to_string(), (*expected).to_owned())
            }
            FaultRefusal::PlantOnly { .. } => {
                ("verb", verb.to_owned(), format!("one that every driver has: {refusal}"))
            }
            FaultRefusal::NoSuchPart { .. } | FaultRefusal::TooMany { .. } | FaultRefusal::Unknown => {
                ("target", target.to_string(), refusal.to_string())
            }
        };
        checks.require(false, format!("{key}{last}"), value, expected);
    }
}

impl VerbName {
    /// As it stands in the file.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Stuck => "stuck",
            Self::Garbage => "garbage",
            Self::Slow => "slow",
            Self::Delayed => "delayed",
            Self::Intermittent => "intermittent",
            Self::Repeated => "repeated",
            Self::Backward => "backward",
            Self::WrongEpoch => "wrong-epoch",
            Self::WrongVersion => "wrong-version",
            Self::Open => "open",
            Self::Shorted => "shorted",
            Self::StuckAmplifier => "stuck-amplifier",
            Self::Stalled => "stalled",
        }
    }
}
