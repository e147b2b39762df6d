//! Another renderer's pictures as recipes use them: their own surface points, parts of them, changes applied to them,
//! and what is handed back. On made-up pictures, on the built-in room, and on plates of Blender where the data is there.

#[path = "support/mod.rs"]
mod support;

#[allow(dead_code)]
#[path = "support/node.rs"]
mod node;
#[allow(dead_code)]
#[path = "support/room.rs"]
mod room;

#[path = "plates/change.rs"]
mod change;
#[path = "plates/files.rs"]
mod files;
#[path = "plates/mattes.rs"]
mod mattes;
#[path = "plates/samples.rs"]
mod samples;
