//! x

#[derive(Clone, Debug, Default)]
pub struct Transfer {}

impl Transfer {
    pub fn bytes(&self) -> u64 {
        0
    }
}
