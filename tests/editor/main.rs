//! The editor, tested as a person would use it: what is on the screen is asked for by its name, clicked, dragged, typed.

mod desk;
mod files;
mod graph;
mod help;
mod inspector;
mod picture;
mod shadows;
mod window;
