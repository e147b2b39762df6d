//! x

#[derive(Clone, Debug, Default)]
pub struct Samples {}

impl Samples {
    pub fn bytes(&self) -> u64 {
        0
    }
}
