//! The editor: builds the document that the command line renders, with the same evaluator. The only folder that names
//! egui.
//!
//! ```text
//! session   an open recipe: undo, problems by node, saved or not
//! history   undo and redo
//! recovery  what is not saved, kept aside
//! keeper    ... on a thread of its own
//! paths     files that a recipe reads, when it moves
//! recent    recipes that were opened last
//! worker    evaluation off the window's thread
//! latest    a thread that does the newest of what it is asked for
//! look      what a viewer looks at, and what must be computed for it
//! shown     what was computed: a picture, and the surfaces that its pixels lie on
//! display   a layer as it is shown: exposure, transform, channels, false colour
//! develop   from what was computed to pixels of the window
//! keys      parameters that change over time
//! thumb     small pictures for nodes
//! hands     what a press, drag or stroke on the picture does to the recipe
//! window    the panes (egui)
//! ```

pub mod develop;
pub mod display;
pub mod hands;
pub mod history;
pub mod keeper;
pub mod keys;
mod latest;
pub mod look;
pub mod paths;
pub mod recent;
pub mod recovery;
pub mod session;
pub mod shown;
pub mod thumb;
pub mod window;
pub mod worker;

pub use session::{OnDisk, Session};
pub use worker::Worker;
