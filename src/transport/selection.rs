//! x

#[derive(Clone, Debug, Default)]
pub struct Selection {}

impl Selection {
    pub fn bytes(&self) -> u64 {
        0
    }
}
