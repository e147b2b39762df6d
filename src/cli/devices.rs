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
        for device in devices {
            let marks = [device.kind, &device.backend, &device.driver, if device.automatic { "(auto)" } else { "" }];
            let marks: Vec<&str> = marks.into_iter().filter(|mark| !mark.is_empty()).collect();
            print(&format!("{:width$}  {}\n", device.name, marks.join(", ")));
        }
        Ok(0)
    }
}
