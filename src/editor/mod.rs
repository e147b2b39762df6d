//! The editor: builds the document that the command line renders, with the same evaluator. The only folder that names
//! egui.
//!
//! ```text
//! session   an open recipe: undo, problems by node, saved or not
//! history   undo and redo
//! recovery  what is not saved, kept aside
//! recent    recipes that were opened last
//! worker    evaluation off the window's thread
//! display   a layer as it is shown: exposure, transform, channels, false colour
//! ```

pub mod display;
pub mod history;
pub mod recent;
pub mod recovery;
pub mod session;
pub mod worker;

pub use session::{OnDisk, Session};
pub use worker::Worker;
