//! How the driver watches its own hardware: temperatures, and whether what is measured follows what is asked.
//!
//! A *deviation* is a measured current or angle too far from its set point; it becomes a fault when it has
//! lasted without a break for a time. A coil whose set point is zero is judged more strictly than one that is
//! driven: a current that nobody asked for has no excuse, while one that lags behind its ramp, or that the
//! supply cannot give for a moment, has. While the bridges are cut nothing is judged but temperature.
//!
//! A fault stands for at least [`STANDS_MIN`], so that no reader misses it, and for as long as a current is
//! measured or a coil is too hot. The bridges stay cut meanwhile, and after it until somebody claims
//! authority anew; what is still broken then is found again.

use magsteer_hal::{Actuation, COILS_MAX, POSE_PARAMETERS_MAX};

use super::fault::Fault;

/// Shortest time for which a fault is reported, s: longer than a reader's patience with old feedback.
pub const STANDS_MIN: f64 = 0.5;

/// When the driver finds fault with its hardware.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WatchSettings {
    /// Deviation of a current from a set point other than zero, A.
    pub current_deviation_max: f64,
    /// Current at a set point of zero, A.
    pub idle_current_max: f64,
    /// How long a current may deviate, s.
    pub current_deviation_time: f64,
    /// Deviation of a frame's angle, rad.
    pub angle_deviation_max: f64,
    /// How long an angle may deviate, s.
    pub angle_deviation_time: f64,
    /// Temperature of a coil that is too hot, K.
    pub temperature_max: f64,
    /// Temperature below which every coil must be before that is over, K.
    pub temperature_release: f64,
}

/// What the driver sees in a step.
#[derive(Debug, Clone, Copy)]
pub struct Seen<'a> {
    /// Set points of coils and frames.
    pub wanted: &'a Actuation,
    /// Measured currents and angles.
    pub measured: &'a Actuation,
    /// Number of coils and frames.
    pub counts: (usize, usize),
    /// The hottest coil and its temperature, K.
    pub hottest: Option<(usize, f64)>,
    /// True while the bridges are cut.
    pub is_cut: bool,
}

/// The driver's watch over its hardware.
#[derive(Debug, Clone)]
pub struct DriverWatch {
    settings: WatchSettings,
    current_steps_max: u32,
    angle_steps_max: u32,
    stands_steps_min: u32,
    current_steps: [u32; COILS_MAX],
    angle_steps: [u32; POSE_PARAMETERS_MAX],
    fault: Option<Fault>,
    /// Steps for which the fault has stood.
    stood_steps: u32,
}

impl DriverWatch {
    /// Without any fault. `step` in s.
    #[must_use]
    pub fn new(settings: WatchSettings, step: f64) -> Self {
        // Saturates at four billion steps.
        let steps = |time: f64| (time / step).ceil() as u32;
        Self {
            current_steps_max: steps(settings.current_deviation_time),
            angle_steps_max: steps(settings.angle_deviation_time),
            stands_steps_min: steps(STANDS_MIN),
            settings,
            current_steps: [0; COILS_MAX],
            angle_steps: [0; POSE_PARAMETERS_MAX],
            fault: None,
            stood_steps: 0,
        }
    }

    /// The fault that stands, for which the bridges are to be cut.
    #[must_use]
    pub fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// Judges a step; the fault that was found in it.
    pub fn judge(&mut self, seen: &Seen) -> Option<Fault> {
        let found = self.current_fault(seen).or(self.angle_fault(seen)).or(self.heat_fault(seen));
        if self.fault.is_some() {
            self.stood_steps = self.stood_steps.saturating_add(1);
            if self.stood_steps >= self.stands_steps_min && self.is_over(seen) {
                self.fault = None;
            }
            return None;
        }
        if found.is_some() {
            self.fault = found;
            self.stood_steps = 0;
        }
        found
    }

    fn current_fault(&mut self, seen: &Seen) -> Option<Fault> {
        let pairs = seen.wanted.current_a.iter().zip(&seen.measured.current_a);
        let mut fault = None;
        for (coil, ((wanted, measured), steps)) in
            pairs.zip(&mut self.current_steps).enumerate().take(seen.counts.0)
        {
            let idle = *wanted == 0.0;
            let most =
                if idle { self.settings.idle_current_max } else { self.settings.current_deviation_max };
            let deviates = !seen.is_cut && (wanted - measured).abs() > most;
            *steps = if deviates { steps.saturating_add(1) } else { 0 };
            if *steps > self.current_steps_max {
                fault = fault.or(Some(Fault::CurrentNotFollowing { coil }));
            }
        }
        fault
    }

    fn angle_fault(&mut self, seen: &Seen) -> Option<Fault> {
        let pairs = seen.wanted.angle_rad.iter().zip(&seen.measured.angle_rad);
        let mut fault = None;
        for (frame, ((wanted, measured), steps)) in
            pairs.zip(&mut self.angle_steps).enumerate().take(seen.counts.1)
        {
            let deviates = !seen.is_cut && (wanted - measured).abs() > self.settings.angle_deviation_max;
            *steps = if deviates { steps.saturating_add(1) } else { 0 };
            if *steps > self.angle_steps_max {
                fault = fault.or(Some(Fault::FrameNotFollowing { frame }));
            }
        }
        fault
    }

    fn heat_fault(&self, seen: &Seen) -> Option<Fault> {
        let (coil, _) = seen.hottest.filter(|(_, hottest)| *hottest > self.settings.temperature_max)?;
        Some(Fault::OverTemperature { coil })
    }

    fn is_over(&self, seen: &Seen) -> bool {
        let flows = |current: &f64| current.abs() > self.settings.idle_current_max;
        let is_hot = match self.fault {
            Some(Fault::OverTemperature { .. }) => {
                seen.hottest.is_some_and(|(_, hottest)| hottest > self.settings.temperature_release)
            }
            _ => false,
        };
        !is_hot && !seen.measured.current_a[..seen.counts.0].iter().any(flows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: f64 = 1e-3;
    const SETTINGS: WatchSettings = WatchSettings {
        current_deviation_max: 1.0,
        idle_current_max: 0.1,
        current_deviation_time: 0.1,
        angle_deviation_max: 0.3,
        angle_deviation_time: 0.2,
        temperature_max: 380.0,
        temperature_release: 360.0,
    };

    /// What the watch is shown, and when it found a fault.
    struct Bench {
        watch: DriverWatch,
        wanted: Actuation,
        measured: Actuation,
        temperature: f64,
        is_cut: bool,
    }

    impl Bench {
        fn new() -> Self {
            Self {
                watch: DriverWatch::new(SETTINGS, STEP),
                wanted: Actuation::default(),
                measured: Actuation::default(),
                temperature: 300.0,
                is_cut: false,
            }
        }

        /// Judges so many steps; the first fault, and after how many.
        fn judge(&mut self, steps: u32) -> Option<(u32, Fault)> {
            (1..=steps).find_map(|step| {
                let fault = self.watch.judge(&Seen {
                    wanted: &self.wanted,
                    measured: &self.measured,
                    counts: (6, 2),
                    hottest: Some((4, self.temperature)),
                    is_cut: self.is_cut,
                });
                fault.map(|fault| (step, fault))
            })
        }
    }

    #[test]
    fn a_current_that_is_off_for_longer_than_its_time_is_a_fault() {
        let mut bench = Bench::new();
        (bench.wanted.current_a[2], bench.measured.current_a[2]) = (3.0, 4.1);
        assert_eq!(bench.judge(100), None);
        bench.measured.current_a[2] = 3.9;
        assert_eq!(bench.judge(1), None);
        bench.measured.current_a[2] = 1.9;
        assert_eq!(bench.judge(1000), Some((101, Fault::CurrentNotFollowing { coil: 2 })));
        assert_eq!(bench.watch.fault().map(Fault::code), Some(2));
    }

    #[test]
    fn a_small_current_that_nobody_asked_for_is_a_fault_and_a_small_lag_is_none() {
        let mut bench = Bench::new();
        (bench.wanted.current_a[0], bench.measured.current_a[0]) = (0.01, 0.2);
        assert_eq!(bench.judge(1000), None);
        bench.wanted.current_a[0] = 0.0;
        assert_eq!(bench.judge(1000), Some((101, Fault::CurrentNotFollowing { coil: 0 })));
    }

    #[test]
    fn an_angle_that_is_off_for_longer_than_its_time_is_a_fault() {
        let mut bench = Bench::new();
        bench.wanted.angle_rad[1] = -0.31;
        assert_eq!(bench.judge(1000), Some((201, Fault::FrameNotFollowing { frame: 1 })));
    }

    #[test]
    fn nothing_but_heat_is_judged_while_the_bridges_are_cut() {
        let mut bench = Bench::new();
        bench.is_cut = true;
        (bench.measured.current_a[0], bench.wanted.angle_rad[1]) = (5.0, 1.0);
        assert_eq!(bench.judge(1000), None);
        bench.temperature = 380.1;
        assert_eq!(bench.judge(1), Some((1, Fault::OverTemperature { coil: 4 })));
    }

    #[test]
    fn a_fault_stands_for_a_while_and_as_long_as_current_flows() {
        let mut bench = Bench::new();
        bench.measured.current_a[0] = 5.0;
        bench.judge(1000);
        bench.is_cut = true;
        bench.judge(1000);
        assert!(bench.watch.fault().is_some(), "a current flows");
        bench.measured.current_a[0] = 0.0;
        bench.judge(1);
        assert!(bench.watch.fault().is_none());
        (bench.is_cut, bench.measured.current_a[0]) = (false, 5.0);
        bench.judge(101);
        (bench.is_cut, bench.measured.current_a[0]) = (true, 0.0);
        bench.judge(499);
        assert!(bench.watch.fault().is_some(), "not long enough");
        bench.judge(1);
        assert!(bench.watch.fault().is_none());
    }

    #[test]
    fn heat_is_over_only_below_the_temperature_of_release() {
        let mut bench = Bench::new();
        bench.temperature = 381.0;
        assert!(bench.judge(1).is_some());
        bench.temperature = 370.0;
        assert_eq!(bench.judge(2000), None);
        assert_eq!(bench.watch.fault(), Some(Fault::OverTemperature { coil: 4 }));
        bench.temperature = 359.0;
        bench.judge(1);
        assert_eq!(bench.watch.fault(), None);
        // Between both nothing new is found.
        bench.temperature = 379.0;
        assert_eq!(bench.judge(2000), None);
    }
}
