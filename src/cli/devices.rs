//! `chiaro devices`: what this machine can compute on.

use super::print;
use crate::{Result, device};

/// List the devices that this machine can compute on
#[derive(clap::Args)]
pub struct Args {}

impl Args {
    pub fn run(self) -> Result<u8> {
        let devices = device::list();
        let width = devices.iter().map(|device| device.name.chars().count()).max().unwrap_or(0);
        for device::Description { name, kind, backend, driver, automatic } in devices {
            let taken = if automatic { "  (taken by --device auto)" } else { "" };
            let line = format!("{name:width$}  {kind:8}  {backend} {driver}");
            print(&format!("{}{taken}\n", line.trim_end()));
        }
        Ok(0)
    }
}
