//! The rig that bytes are about.

use std::sync::LazyLock;
use std::time::Duration;

use magsteer::config::{Config, Document};
use magsteer_hal::fault::Injector;
use magsteer_hal::{CoilCommand, CoilFeedback, HardwareDescription, HeaderWriter, PoseMessage, Stamp};

/// The shipped planar rig.
pub static SHIPPED: LazyLock<Config> = LazyLock::new(|| {
    let document =
        Document::from_text("shipped", include_str!("../../../config/bigmag-planar.toml")).expect("TOML");
    Config::from_document(&document).expect("shipped")
});
pub static RIG: LazyLock<HardwareDescription> = LazyLock::new(|| SHIPPED.description.clone());

/// Takes an injector through two seconds.
pub fn run(injector: &mut Injector) {
    let mut header = HeaderWriter::new(1);
    for step in 1..20_u32 {
        let now = Stamp::from_nanoseconds(1).after(step * Duration::from_millis(100));
        injector.offer_pose(PoseMessage::default(), now);
        injector.offer_feedback(CoilFeedback::default(), now);
        let _ = injector.take_pose(&mut header, now);
        let _ = injector.take_feedback(&mut header, now);
        let _ = injector.command(&CoilCommand::default(), now);
        while injector.next_condition(now).is_some() {}
        while injector.take_event().is_some() {}
    }
}
