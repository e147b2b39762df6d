//! `chiaro devices`: what this machine can compute on.

use super::print;
use crate::{Result, device};

/// List the devices that this machine can compute on
#[derive(clap::Args)]
pub struct Args {}

impl Args {
    pub fn run(self) -> Result<u8> {
        let devices = device::list();
        let width = devices.iter().map(|(name, ..)| name.chars().count()).max().unwrap_or(0);
        for (name, kind, detail) in devices {
            print(&format!("{name:width$}  {kind:12}  {detail}\n"));
        }
        Ok(0)
    }
}
