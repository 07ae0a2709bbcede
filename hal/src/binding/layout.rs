//! Memory layouts as data.

use crate::channels;
use crate::message::{Actuation, CoilFeedback, Header, MagnetPose, PoseMessage};
use crate::operator::{LoopTiming, PhaseQuantiles, Quantiles};
use crate::record::{
    AbsenceMessage, AnswerMessage, CycleMessage, PhasesMessage, RequestMessage, TargetMessage, TickMessage,
};

/// The layout of one message, or of a part of some.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    /// Name of the type.
    pub name: &'static str,
    /// Bytes.
    pub size: usize,
    /// Bytes.
    pub align: usize,
    /// In order.
    pub fields: Vec<Field>,
}

/// One field.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    /// Its name; the unit is its last word.
    pub name: &'static str,
    /// Bytes from the begin of the message.
    pub offset: usize,
    /// What it is made of.
    pub kind: Kind,
}

/// What a field is made of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Kind {
    /// Unsigned, 32 bits.
    U32,
    /// Unsigned, 64 bits.
    U64,
    /// IEEE 754, 64 bits.
    F64,
    /// So many of one kind.
    Array(Box<Self>, usize),
    /// Another layout, by its name.
    Part(&'static str),
}

/// Types that fields can have.
pub(crate) trait HasKind {
    fn kind() -> Kind;
}

impl HasKind for u32 {
    fn kind() -> Kind {
        Kind::U32
    }
}

impl HasKind for u64 {
    fn kind() -> Kind {
        Kind::U64
    }
}

impl HasKind for f64 {
    fn kind() -> Kind {
        Kind::F64
    }
}

impl<T: HasKind, const N: usize> HasKind for [T; N] {
    fn kind() -> Kind {
        Kind::Array(Box::new(T::kind()), N)
    }
}

macro_rules! parts {
    ($($part:ident),+ $(,)?) => {
        $(impl HasKind for $part {
            fn kind() -> Kind {
                Kind::Part(stringify!($part))
            }
        })+
    };
}

parts!(
    Header,
    MagnetPose,
    Actuation,
    Quantiles,
    PhaseQuantiles,
    LoopTiming,
    PoseMessage,
    CoilFeedback,
    TickMessage,
    AbsenceMessage,
    TargetMessage,
    RequestMessage,
    AnswerMessage,
    PhasesMessage,
    CycleMessage,
);

/// The layouts of all messages, parts before what holds them.
#[must_use]
pub fn layouts() -> Vec<Layout> {
    channels::layout::layouts()
}

/// First eight bytes of the SHA-256 of all layouts, in hexadecimal: the attribute `magsteer-schema` of every
/// service.
#[must_use]
pub fn schema_hash() -> String {
    channels::layout::schema_hash()
}

/// The names under which the transport knows the messages.
#[must_use]
pub const fn type_names() -> [(&'static str, &'static str); 6] {
    [
        ("PoseMessage", "magsteer_pose_v1"),
        ("CoilCommand", "magsteer_coil_command_v1"),
        ("CoilFeedback", "magsteer_coil_feedback_v2"),
        ("OperatorRequest", "magsteer_operator_request_v3"),
        ("OperatorAnswer", "magsteer_operator_answer_v1"),
        ("StatusMessage", "magsteer_status_v7"),
    ]
}
