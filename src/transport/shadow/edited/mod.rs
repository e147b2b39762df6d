//! Light of edited visibility (thesis 6.6, 6.7.3). Rows stay as they were baked; edits act when light is asked for.

pub mod amounts;
pub mod chain;
mod taps;
