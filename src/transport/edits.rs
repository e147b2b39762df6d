//! An ordered list of light-transport edits. An edit is data: it never renders.

#[derive(Clone, Debug, Default)]
pub struct Edits {}

impl Edits {
    pub fn bytes(&self) -> u64 {
        0
    }
}
