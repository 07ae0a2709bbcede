//! All clauses in their order: on fresh rigs, each for itself, or on one running rig up to a level.

use std::time::Instant;

use super::clause::{Clause, Level};
use super::finding::{Finding, Measured, Outcome, Verdict, Violation};
use super::garbage::Garbage;
use super::harness::Rig;
use super::trial::Trial;
use super::{clauses, commands, listening, sweep, watchdog};

/// A clause, or some that one measurement settles, tried on a rig.
struct Attempt<R> {
    stage: Stage,
    clauses: Vec<Clause>,
    attempt: Box<Try<R>>,
}

/// Tries to break clauses on a rig; what became of each.
type Try<R> = dyn Fn(&mut R) -> Vec<(Clause, Outcome)>;

/// What must hold before something else is worth trying.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    /// The suite's own harness.
    Inside,
    /// Listening.
    Listening,
    /// A claim.
    Claim,
    /// Commands at zero current.
    Dry,
    /// Frames.
    Frames,
    /// Which coil answers, and how.
    Channels,
    /// Currents.
    Driven,
}

impl Stage {
    const fn level(self) -> Level {
        match self {
            Self::Inside | Self::Listening => Level::Static,
            Self::Claim | Self::Dry => Level::Dry,
            Self::Frames | Self::Channels | Self::Driven => Level::DummyLoad,
        }
    }
}

/// Runs of a clause in which the suite or the driver was held up by the machine are repeated so often.
const ATTEMPTS_MAX: u32 = 5;

/// Tries every clause on a fresh rig each, made by `make`. Nothing found means that the contract is kept as
/// far as the harness lets it be tried.
pub fn run<R: Rig>(mut make: impl FnMut() -> R) -> Vec<Violation> {
    let mut found = Vec::new();
    for attempt in all::<R>() {
        for (clause, outcome) in (attempt.attempt)(&mut make()) {
            if let Err(detail) = outcome {
                found.push(Violation { clause, detail });
            }
        }
    }
    found
}

/// Tries every clause up to `level` on one running rig, and hands each finding to `tell` as it is made.
///
/// A stage is left out when one before it broke: currents are not driven through a driver that mixes up its
/// coils. The rig is brought back to idle at zero current between clauses and at the end.
pub fn examine<R: Rig>(rig: &mut R, level: Level, mut tell: impl FnMut(&Finding)) -> Vec<Finding> {
    let mut findings: Vec<Finding> = Vec::new();
    for attempt in all::<R>() {
        if attempt.stage == Stage::Inside || attempt.stage.level() > level {
            continue;
        }
        let made = match obstacle(&findings, attempt.stage, rig.is_interrupted()) {
            Some(why) => attempt.clauses.iter().map(|clause| skipped(*clause, why)).collect(),
            None => tried(&attempt, rig),
        };
        for finding in made {
            tell(&finding);
            findings.push(finding);
        }
    }
    if level > Level::Static {
        rig.release_all();
    }
    findings
}

/// Why a stage is not worth trying.
fn obstacle(findings: &[Finding], stage: Stage, is_interrupted: bool) -> Option<&'static str> {
    if is_interrupted {
        return Some("interrupted");
    }
    let broken = |wanted: fn(Clause) -> bool| {
        findings.iter().any(|finding| finding.verdict == Verdict::Broken && wanted(finding.clause))
    };
    let is_channel = |clause| {
        use Clause::{CurrentCrosstalk, CurrentOrder, CurrentScale, CurrentSign};
        matches!(clause, CurrentSign | CurrentOrder | CurrentScale | CurrentCrosstalk)
    };
    let is_heard = |clause: Clause| {
        use Clause::{PoseContents, PoseRate, PoseSequence, PoseStamps};
        // A rig whose tracker is not there yet may well have its amplifiers tried.
        let of_poses = matches!(clause, PoseContents | PoseRate | PoseSequence | PoseStamps);
        clause.level() == Level::Static && !of_poses
    };
    match stage {
        Stage::Inside | Stage::Listening => None,
        _ if broken(is_heard) => Some("mend what is heard first"),
        Stage::Claim => None,
        _ if broken(|clause| clause == Clause::ClaimIsEchoed) => Some("mend the claim first"),
        Stage::Dry => None,
        _ if broken(|clause| clause.level() == Level::Dry) => Some("mend the dry checks first"),
        Stage::Frames | Stage::Channels => None,
        Stage::Driven if broken(is_channel) => Some("mend the channels first"),
        Stage::Driven => None,
    }
}

fn skipped(clause: Clause, why: &str) -> Finding {
    Finding { clause, verdict: Verdict::NotTried, measured: why.to_owned(), elapsed_s: 0.0 }
}

/// Tries, from rest, and again when the machine was in the way.
fn tried<R: Rig>(attempt: &Attempt<R>, rig: &mut R) -> Vec<Finding> {
    let start = Instant::now();
    let mut made = Vec::new();
    for _ in 0..ATTEMPTS_MAX {
        let at_rest = if attempt.stage.level() > Level::Static {
            rig.release_all();
            Trial::new(rig).restore()
        } else {
            Ok(())
        };
        rig.was_held_up();
        made = match at_rest {
            Ok(()) => (attempt.attempt)(rig),
            Err(why) => {
                let why = format!("the rig does not come to rest: {why}");
                attempt.clauses.iter().map(|clause| (*clause, Err(why.clone()))).collect()
            }
        };
        let is_broken = made.iter().any(|(_, outcome)| outcome.is_err());
        if !is_broken || !rig.was_held_up() || rig.is_interrupted() {
            break;
        }
    }
    let elapsed_s = start.elapsed().as_secs_f64();
    made.into_iter()
        .map(|(clause, outcome)| finding(clause, outcome, elapsed_s, rig.is_interrupted()))
        .collect()
}

fn finding(clause: Clause, outcome: Outcome, elapsed_s: f64, is_interrupted: bool) -> Finding {
    let (verdict, measured) = match outcome {
        Ok(Measured::Found(what)) => (Verdict::Kept, what),
        Ok(Measured::NotTried(why)) => (Verdict::NotTried, why.to_owned()),
        Err(_) if is_interrupted => (Verdict::NotTried, "interrupted".to_owned()),
        Err(how) => (Verdict::Broken, how),
    };
    Finding { clause, verdict, measured, elapsed_s }
}

fn one<R: 'static>(stage: Stage, clause: Clause, attempt: fn(&mut R) -> Outcome) -> Attempt<R> {
    Attempt { stage, clauses: vec![clause], attempt: Box::new(move |rig| vec![(clause, attempt(rig))]) }
}

fn several<R: 'static>(
    stage: Stage,
    clauses: &[Clause],
    attempt: fn(&mut R) -> Vec<(Clause, Outcome)>,
) -> Attempt<R> {
    Attempt { stage, clauses: clauses.to_vec(), attempt: Box::new(attempt) }
}

/// Every clause with the attempt to break it, the harmless first.
fn all<R: Rig>() -> Vec<Attempt<R>> {
    let mut all = vec![
        one(Stage::Inside, Clause::NothingIsNever, clauses::nothing_is_never),
        one(Stage::Inside, Clause::GarbageIsRefused, clauses::garbage_is_refused),
        several(Stage::Listening, &LISTENED, listening::listen),
        one(Stage::Claim, Clause::FeedbackArrives, clauses::feedback_arrives),
        one(Stage::Claim, Clause::ClaimIsEchoed, clauses::claim_is_echoed),
        one(Stage::Dry, Clause::RivalIsRefused, clauses::rival_is_refused),
    ];
    for garbage in Garbage::ALL {
        all.push(Attempt {
            stage: Stage::Dry,
            clauses: vec![Clause::Garbage(garbage)],
            attempt: Box::new(move |rig| {
                vec![(Clause::Garbage(garbage), commands::garbage_command_is_refused(rig, garbage))]
            }),
        });
    }
    all.extend([
        one(Stage::Dry, Clause::FormerEpochIsRefused, commands::former_epoch_is_refused),
        one(Stage::Dry, Clause::LapseEndsAuthority, watchdog::lapse_ends_authority),
        one(Stage::Dry, Clause::ReleaseFrees, commands::release_frees),
        one(Stage::Dry, Clause::DisableIsKept, clauses::disable_is_kept),
        several(Stage::Frames, &TURNED, sweep::angles),
        several(Stage::Channels, &SWEPT, sweep::currents),
        one(Stage::Driven, Clause::NoDriveWithoutClaim, clauses::no_drive_without_claim),
        one(Stage::Driven, Clause::CurrentsFollowWithinSlew, clauses::currents_follow_within_slew),
        one(Stage::Driven, Clause::JumpIsSlewed, commands::jump_is_slewed),
        one(Stage::Driven, Clause::OverLimitIsHeld, commands::over_limit_is_held),
        one(Stage::Driven, Clause::AuthorityIsExclusive, clauses::authority_is_exclusive),
        several(Stage::Driven, &LAPSED, watchdog::lapse_ramps_down),
        one(Stage::Driven, Clause::OrderRampsDown, watchdog::order_ramps_down),
        one(Stage::Driven, Clause::ReleaseRampsDown, clauses::release_ramps_down),
        one(Stage::Driven, Clause::DisableLatches, clauses::disable_latches),
    ]);
    all
}

const LISTENED: [Clause; 12] = [
    Clause::LayoutVersion,
    Clause::Fingerprint,
    Clause::FeedbackSequence,
    Clause::FeedbackStamps,
    Clause::FeedbackContents,
    Clause::FeedbackRate,
    Clause::CurrentAtRest,
    Clause::AnglesInRange,
    Clause::PoseSequence,
    Clause::PoseStamps,
    Clause::PoseContents,
    Clause::PoseRate,
];
const TURNED: [Clause; 3] = [Clause::AngleOrder, Clause::AngleSign, Clause::AngleScale];
const SWEPT: [Clause; 4] =
    [Clause::CurrentOrder, Clause::CurrentSign, Clause::CurrentScale, Clause::CurrentCrosstalk];
const LAPSED: [Clause; 2] = [Clause::LapseRampsDown, Clause::LapseRampKeepsSlew];
