//! What each sample sees of an environment, past groups of objects (thesis 6.4, 6.7.3). Kept on disk by group and face.

use crate::node::{Facet, Info, Inputs, Job, Key, Node, Port};
use crate::scene::cube::{self, FACE_NAMES, FACES};
use crate::scene::{Environment, Geometry, Occluders, SurfacePoint};
use crate::transport::Samples;
use crate::transport::shadow::bake::{self, Settings};
use crate::transport::shadow::blind::blind;
use crate::transport::shadow::haar::Truncation;
use crate::transport::shadow::tiles::Tiles;
use crate::transport::shadow::visibility::{Basis, Group, Rows, Visibility as Seen};
use crate::value::{Kind, Value};
use crate::{Error, Result, kernels, names};
use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::cell::OnceCell;
use std::sync::Arc;

#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Visibility {
    /// Texels along a side of each cube face; a power of two, that of the environment.
    #[schemars(range(min = 32, max = 512), extend("unit" = "texels"))]
    pub face_size: u32,
    /// `runs` keeps what is hidden exactly; `haar2d` and `haar1d` keep the heaviest wavelet coefficients (thesis).
    pub basis: Basis,
    /// Haar coefficients kept of a sample and face, at most.
    #[schemars(range(min = 1, max = 262144))]
    pub coefficients: u32,
    /// Share of a row's weighted energy that its Haar coefficients may leave out; null: keep as many as `coefficients`
    /// says.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub tolerance: Option<f32>,
    /// Objects whose shadows are kept apart: names, and patterns with `*`, `?` and `[...]`. All others form the group
    /// `rest`; without groups, all objects form the group `all`.
    pub groups: IndexMap<String, Vec<String>>,
    /// The cube faces to look through: right (+X), left, top (+Y), bottom, front (+Z), back; empty: all. From others,
    /// light comes without shadows.
    pub faces: Vec<String>,
}

impl Default for Visibility {
    fn default() -> Self {
        Self {
            face_size: 128,
            basis: Basis::Runs,
            coefficients: 200,
            tolerance: None,
            groups: IndexMap::new(),
            faces: Vec::new(),
        }
    }
}

const PLACES: &[Facet] = &[Facet::Geometry];

impl Node for Visibility {
    const INFO: Info = Info {
        name: "visibility",
        category: "shadows",
        summary: "What each sample sees of an environment, past groups of objects",
        inputs: &[
            Port::new("scene", Kind::Scene, "What casts shadows").reads(PLACES),
            Port::new("samples", Kind::Samples, "The view").reads(PLACES),
            Port::new(
                "environment",
                Kind::Environment,
                "Where light comes from: directions without any are left out, and shadows cannot be moved out of them",
            )
            .optional(),
        ],
        outputs: &[Port::new("visibility", Kind::Visibility, "Hidden directions, per group, cube face and sample")],
        in_parts: true,
        ..Info::NEW
    };

    fn run(&self, inputs: &Inputs, job: &Job) -> Result<Vec<Value>> {
        let geometry = inputs.geometry("scene")?;
        let samples = inputs.need_whole_samples("samples")?;
        samples.check(&geometry)?;
        let size = self.face_size as usize;
        let environment = inputs.environment("environment");
        if let Some(environment) = environment.filter(|environment| environment.size != size) {
            let other = environment.size;
            let message = format!("face_size is {size}, the environment's faces have {other} x {other} texels");
            return Err(Error::compute(message, "set face_size of both nodes to the same number"));
        }
        let truncation = Truncation { coefficients: self.coefficients as usize, tolerance: self.tolerance };
        let settings = Settings { face: 0, size, basis: self.basis, truncation };
        settings.check()?;
        let mut bake = Bake {
            job,
            geometry: &geometry,
            samples,
            place: inputs.key("samples", Facet::Geometry).expect("samples are connected"),
            settings,
            environment,
            tiles: Tiles::new(job.memo, &geometry, job.part),
            told: Told::default(),
        };
        let asked = self.asked()?;
        let wanted = self.groups.iter().map(|(name, patterns)| (name.as_str(), patterns.as_slice()));
        let groups: Vec<Group> = bake::groups(wanted, &geometry)?
            .into_iter()
            .map(|(name, objects)| bake.group(name, objects, asked))
            .collect::<Result<_>>()?;
        let [reused, computed] = bake.tiles.counts.get();
        if bake.tiles.keeps() {
            job.note("tiles_found", reused);
            job.note("tiles_computed", computed);
        }
        if bake.tiles.is_part() {
            return Ok(Vec::new());
        }
        bake.tell(asked, groups.len());
        let edits = Vec::new();
        let lit_only = environment.is_some();
        let visibility =
            Seen { samples: samples.clone(), size, basis: self.basis, truncation, lit_only, groups, edits };
        let blind = blind(&visibility, environment.map(|environment| &**environment));
        job.note("blind_samples", blind);
        if 100 * blind > samples.points.len() {
            job.warn(format!("{blind} samples see nothing at all and stay black: they lie inside of objects"));
        }
        Ok(vec![Value::Visibility(Arc::new(visibility))])
    }
}

impl Visibility {
    fn asked(&self) -> Result<[bool; FACES]> {
        let mut asked = [self.faces.is_empty(); FACES];
        for name in &self.faces {
            let face = cube::face_of(name).ok_or_else(|| {
                let message = format!("there is no cube face \"{name}\"");
                Error::compute(message, names::suggest(name, FACE_NAMES))
            })?;
            asked[face] = true;
        }
        Ok(asked)
    }
}

struct Bake<'a> {
    job: &'a Job<'a>,
    geometry: &'a Geometry,
    samples: &'a Samples,
    /// Names the samples and what they lie on.
    place: Key,
    settings: Settings,
    environment: Option<&'a Arc<Environment>>,
    tiles: Tiles<'a>,
    told: Told,
}

/// Sums for the report.
#[derive(Default)]
struct Told {
    rows: usize,
    /// Rows that hide anything.
    shaded: usize,
    /// Toggles or coefficients of all rows, and of the longest.
    entries: usize,
    longest: usize,
    bytes: u64,
}

impl Bake<'_> {
    fn group(&mut self, name: String, objects: Vec<u32>, asked: [bool; FACES]) -> Result<Group> {
        let occluders = OnceCell::new();
        let mut faces = [const { None }; FACES];
        for face in (0..FACES).filter(|face| asked[*face]) {
            let wanted = match self.environment {
                Some(environment) => match bake::wanted(environment, face) {
                    None => continue,
                    lit => lit,
                },
                None => None,
            };
            let rows = self.rows(&name, &objects, face, wanted.as_deref(), &occluders)?;
            if let Some(rows) = &rows {
                self.told.add(rows);
            }
            faces[face] = rows;
        }
        Ok(Group { name, objects, faces })
    }

    fn rows(
        &self,
        name: &str,
        objects: &[u32],
        face: usize,
        wanted: Option<&[u32]>,
        occluders: &OnceCell<Occluders>,
    ) -> Result<Option<Arc<Rows>>> {
        let (job, geometry) = (self.job, self.geometry);
        let settings = Settings { face, ..self.settings };
        // What makes no difference to runs does not name them.
        let truncation = self.settings.basis.haar().map(|basis| (basis, self.settings.truncation));
        let how = serde_json::to_vec(&(face, settings.size, truncation)).expect("plain data");
        let (list, lit) = (bytemuck::cast_slice(objects), bytemuck::cast_slice(wanted.unwrap_or(&[])));
        let key = Key::of(&[b"visibility rows", &self.place.0, &geometry.fingerprint, list, &how, lit]);
        let of_tile = Key::of(&[&how, lit]);
        let tile = |points: &[SurfacePoint]| self.tiles.key(points, objects, face, of_tile);
        let kept = Some((&self.tiles, &tile as &dyn Fn(&[SurfacePoint]) -> Key));
        let compute = || {
            let occluders = occluders.get_or_init(|| {
                let mut casts = vec![false; geometry.objects.len()];
                objects.iter().for_each(|object| casts[*object as usize] = true);
                Occluders::new(geometry, |object| casts[object as usize])
            });
            let stage = format!("shadows of {name}, {}", FACE_NAMES[face]);
            let stage = job.progress.stage(&stage, self.samples.points.len() as u64);
            let draw = |points: &[_], face, size, wanted: Option<&[u32]>| {
                kernels::visibility_masks(job.device, occluders, points, face, size, wanted)
            };
            bake::face(&draw, &self.samples.points, &settings, wanted, kept, &stage)
        };
        if self.tiles.is_part() {
            return compute().map(|_| None);
        }
        let whole = || compute().map(|rows| rows.expect("no part is asked for"));
        job.keep(key, Rows::bytes, whole).map(Some)
    }

    fn tell(&self, asked: [bool; FACES], groups: usize) {
        let (job, told) = (self.job, &self.told);
        let dark = |face: usize| self.environment.is_some_and(|light| bake::wanted(light, face).is_none());
        let listed = |choose: &dyn Fn(usize) -> bool| -> Vec<&str> {
            (0..FACES).filter(|face| asked[*face] && choose(*face)).map(|face| FACE_NAMES[face]).collect()
        };
        job.note("groups", groups);
        job.note("faces", listed(&|face| !dark(face)));
        job.note("faces_skipped", listed(&dark));
        if let Some(light) = self.environment {
            let lit = (0..FACES).filter(|face| asked[*face]).filter_map(|face| bake::wanted(light, face));
            let texels: u32 = lit.flatten().map(u32::count_ones).sum();
            job.note("texels_with_energy", texels);
        }
        job.note("rows", told.rows);
        job.note("rows_with_shadow", told.shaded);
        let (what, most) = match self.settings.basis {
            Basis::Runs => ("toggles_per_row", "most_toggles"),
            Basis::Haar1d | Basis::Haar2d => ("coefficients_per_row", "most_coefficients"),
        };
        job.note(what, (10.0 * told.entries as f64 / told.rows.max(1) as f64).round() / 10.0);
        job.note(most, told.longest);
        job.note("bytes", told.bytes);
    }
}

impl Told {
    fn add(&mut self, rows: &Rows) {
        for row in 0..rows.rows() {
            let count = rows.count(row);
            self.shaded += usize::from(count > 0);
            self.entries += count;
            self.longest = self.longest.max(count);
        }
        self.rows += rows.rows();
        self.bytes += rows.bytes();
    }
}
