//! Light from far away, all around: a latitude-longitude map, laid on a cube.

use crate::image::{ColourSpace, Image, colour, load};
use crate::node::{Info, Inputs, Job, Node, Port, frame_path};
use crate::scene::builtin::skies;
use crate::scene::{LatLong, cube};
use crate::transport::shadow::localize::COARSE;
use crate::value::{Kind, Value};
use crate::{Error, Result};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::path::Path;
use std::sync::Arc;

/// The centre of the map faces +X, columns run towards +Z, the top row is +Y. Energy (radiance times solid angle) is that
/// of the map at any size and rotation.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Environment {
    /// A latitude-longitude map, EXR or HDR, twice as wide as high, or `builtin:NAME` for one that ships in the program
    /// (`builtin:sky`, `builtin:lamps`). `####`, `%04d` and `$F4` are the frame. PNG and JPEG are taken as sRGB; they
    /// hold no bright lamps.
    pub file: String,
    /// Along a side of each of the six faces; a power of two. Lamps smaller than a texel cast shadows with steps.
    #[schemars(range(min = 32, max = 512), extend("unit" = "texels"))]
    pub face_size: u32,
    /// About +Y, right-handed: 90 takes what was at +Z to +X.
    #[schemars(extend("unit" = "degrees"))]
    pub rotation: f32,
    /// Radiance is multiplied by 2 to this power.
    #[schemars(range(min = -40.0, max = 40.0), extend("unit" = "stops"))]
    pub exposure: f32,
}

impl Default for Environment {
    fn default() -> Self {
        Self { file: "builtin:sky".into(), face_size: 128, rotation: 0.0, exposure: 0.0 }
    }
}

const BUILTIN: &str = "builtin:";

impl Node for Environment {
    const INFO: Info = Info {
        name: "environment",
        category: "in and out",
        summary: "Light from all around: a latitude-longitude map from a file or from the program",
        outputs: &[Port::new("environment", Kind::Environment, "Radiance on the six faces of a cube")],
        uses_frame: true,
        ..Info::NEW
    };

    fn files(&self) -> Vec<String> {
        if self.file.starts_with(BUILTIN) { vec![] } else { vec![self.file.clone()] }
    }

    fn uses_frame(&self, _base: &Path) -> bool {
        !self.file.starts_with(BUILTIN) && frame_path(&self.file, 0.0) != self.file
    }

    fn run(&self, _: &Inputs, job: &Job) -> Result<Vec<Value>> {
        cube::check_size(self.face_size as usize)?;
        let map = match self.file.strip_prefix(BUILTIN) {
            Some(name) => built_in(name)?,
            None => read(&job.path(&frame_path(&self.file, job.frame)))?,
        };
        job.note("map", vec![map.size().0, map.size().1]);
        let (rotation, gain) = (f64::from(self.rotation).to_radians(), f64::from(self.exposure).exp2());
        let environment = map.cube(self.face_size as usize, rotation, gain)?;
        let luminance = |rgb: [f64; 3]| colour::luminance(Vec3::from(rgb.map(|x| x as f32)));
        let energy = environment.energy(0..environment.radiance.len());
        job.note("energy", energy.to_vec());
        if luminance(energy) == 0.0 {
            job.warn("the environment is black");
        } else {
            let of = |texel: usize| luminance(environment.energy(texel..texel + 1));
            let texels = 0..environment.radiance.len();
            let brightest = texels.max_by(|a, b| of(*a).total_cmp(&of(*b)).then(b.cmp(a))).unwrap_or(0);
            let direction = cube::texel_point(brightest, environment.size).normalize();
            let texel = json!({
                "texel": brightest,
                "direction": direction.to_array(),
                "radiance": environment.radiance[brightest][..3],
                "share": of(brightest) / luminance(energy),
            });
            job.note("brightest", texel);
            let share = f64::from(of(brightest) / luminance(energy));
            if share > COARSE {
                let percent = 100.0 * share;
                let warning = format!(
                    "one texel of {} x {} a face holds {percent:.0} % of the light: shadows of it have steps, and are \
                     as soft as it is wide; raise face_size",
                    environment.size, environment.size
                );
                job.warn(warning);
            }
        }
        let lit = cube::FACE_NAMES.iter().zip(environment.lit_faces()).filter(|(_, lit)| *lit);
        job.note("lit_faces", lit.map(|(name, _)| *name).collect::<Vec<_>>());
        Ok(vec![Value::Environment(Arc::new(environment))])
    }
}

fn built_in(name: &str) -> Result<LatLong> {
    skies::map(name).ok_or_else(|| {
        let known = skies::names().collect::<Vec<_>>().join(", ");
        Error::compute(format!("no environment called \"{name}\" ships in the program"), format!("there is {known}"))
    })
}

/// The beauty of a picture, as a map; grey where it has one channel alone.
fn read(path: &Path) -> Result<LatLong> {
    let Image { width, height, layers, .. } = load::load(path, Some(&[""]))?.to_space(ColourSpace::Rec709);
    let layer = &layers[0];
    let channels = match (layer.rgb(), layer.channels.len()) {
        (Some(rgb), _) => rgb,
        (None, 1) => [0; 3],
        _ => {
            let message = format!("the beauty has channels {}, not red, green and blue", layer.channels.join(", "));
            return Err(Error::file(path, message, "give a picture in colour"));
        }
    };
    let pixels = layer.data.chunks(layer.channels.len()).map(|pixel| channels.map(|channel| pixel[channel]));
    LatLong::new(width, height, pixels.collect()).map_err(|error| match error {
        Error::Compute { message, help } => Error::file(path, message, help),
        other => other,
    })
}
