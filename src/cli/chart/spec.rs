//! What a chart sweeps: from the command line, or from a file that holds the same.

use super::Args;
use super::settings::{Settings, setting, shown, values};
use crate::cli::side::Side;
use crate::{Error, Result};
use indexmap::IndexMap;
use serde::Deserialize;
use serde_json::Value as Json;
use std::fmt;
use std::path::{Path, PathBuf};

/// Values that are swept together: every combination of them.
pub type Product = IndexMap<String, Vec<Json>>;

/// A chart as a file has it. Paths are relative to the file.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Written {
    /// Version of this form: 1.
    chart: u32,
    title: String,
    graph: PathBuf,
    node: Option<String>,
    layer: String,
    set: Settings,
    sweep: Sweep,
    reference: Settings,
    against: Option<Plate>,
    objects: Option<PathBuf>,
    blocks: Option<u16>,
    default: Settings,
    why: String,
    beside: IndexMap<String, PathBuf>,
    runs: Option<u16>,
}

/// One product of values, or several side by side, as for bases that have other parameters.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
enum Sweep {
    One(Product),
    Several(Vec<Product>),
}

impl Default for Sweep {
    fn default() -> Self {
        Self::Several(Vec::new())
    }
}

/// A layer of a picture that others rendered.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Plate {
    pub file: PathBuf,
    #[serde(default)]
    pub layer: String,
    /// It is multiplied by these layers of its file.
    #[serde(default)]
    pub times: Vec<String>,
}

/// What points are held against.
#[derive(Clone, Debug, PartialEq)]
pub enum Reference {
    /// The recipe, with these settings.
    Set(Settings),
    Plate(Plate),
}

impl fmt::Display for Reference {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Set(settings) => {
                let each = settings.iter().map(|(name, value)| format!("{name} = {}", shown(value)));
                f.write_str(&each.collect::<Vec<_>>().join(", "))
            }
            Self::Plate(plate) => {
                let file = plate.file.file_name().unwrap_or_default().to_string_lossy();
                let layer = crate::image::names::title(&plate.layer);
                write!(f, "{file}, {layer}")?;
                plate.times.iter().try_for_each(|factor| write!(f, " x {factor}"))
            }
        }
    }
}

/// A chart to be made.
#[derive(Clone, Debug)]
pub struct Spec {
    /// Of the files that are written.
    pub name: String,
    pub title: String,
    pub graph: PathBuf,
    /// `None`: the only one that the recipe writes.
    pub node: Option<String>,
    /// "" is the beauty.
    pub layer: String,
    /// Of all points, and of the reference.
    pub set: Settings,
    pub products: Vec<Product>,
    pub reference: Reference,
    /// A picture whose Cryptomatte parts objects, where errors are of blocks.
    pub objects: Option<PathBuf>,
    /// Side of those blocks in pixels.
    pub blocks: u16,
    /// Settings of the point that is the default, and why it is.
    pub default: Settings,
    pub why: String,
    /// Tables of other programs, `seconds,error` a line, by their names.
    pub beside: IndexMap<String, PathBuf>,
    pub runs: u16,
}

impl Spec {
    /// The chart that a file holds, or that the options ask for of a recipe.
    ///
    /// # Errors
    /// `File` where the file cannot be read, `Usage` where there is nothing to sweep or to hold it against.
    pub fn new(path: &Path, args: &Args) -> Result<Self> {
        let mut written = written(path)?;
        let product: Product = args.sweeps.iter().map(|text| values(text)).collect::<Result<_>>()?;
        if !product.is_empty() {
            written.sweep = Sweep::One(product);
        }
        for text in &args.sets {
            let (setting, value) = setting("--set", text)?;
            written.set.insert(setting, value);
        }
        for text in &args.reference {
            let (setting, value) = setting("--reference", text)?;
            written.reference.insert(setting, value);
        }
        if let Some(text) = &args.against {
            let Side { path, layer } = Side::parse(text);
            let plate = Plate { file: path, layer: layer.unwrap_or_default(), times: args.times.clone() };
            (written.against, written.reference) = (Some(plate), Settings::new());
        }
        for text in &args.beside {
            let (name, file) = text.split_once('=').ok_or_else(|| {
                let message = format!("--beside {text}: this is not NAME=FILE.csv");
                Error::usage(message, "name a table of seconds and errors, as in --beside Cycles=cycles.csv")
            })?;
            written.beside.insert(name.to_owned(), file.into());
        }
        written.objects = args.objects.clone().or(written.objects);
        written.blocks = args.blocks.or(written.blocks);
        written.node = args.node.clone().or(written.node);
        written.layer = args.layer.clone().unwrap_or(written.layer);
        written.runs = args.runs.or(written.runs);
        written.checked(path)
    }

    /// Every combination of swept values, product by product, the last setting of each fastest.
    pub fn combinations(&self) -> Vec<Settings> {
        self.products.iter().flat_map(combinations).collect()
    }

    /// It is the point that the chart calls the default.
    pub fn is_default(&self, settings: &Settings) -> bool {
        !self.default.is_empty() && self.default.iter().all(|(name, value)| settings.get(name) == Some(value))
    }
}

fn combinations(product: &Product) -> Vec<Settings> {
    let mut all = vec![Settings::new()];
    for (setting, values) in product {
        let with = |before: &Settings, value: &Json| {
            let mut settings = before.clone();
            settings.insert(setting.clone(), value.clone());
            settings
        };
        all = all.iter().flat_map(|before| values.iter().map(move |value| with(before, value))).collect();
    }
    all
}

impl Written {
    fn checked(self, path: &Path) -> Result<Spec> {
        let products = match self.sweep {
            Sweep::One(product) => vec![product],
            Sweep::Several(products) => products,
        };
        if products.is_empty() || products.iter().any(|p| p.is_empty() || p.values().any(Vec::is_empty)) {
            let help = "name values, as in --sweep transport.tolerance=0.08,0.04,0.02";
            return Err(Error::usage(format!("{}: nothing is swept", path.display()), help));
        }
        let reference = match (self.against, self.reference) {
            (Some(plate), set) if set.is_empty() => Reference::Plate(plate),
            (None, set) if !set.is_empty() => Reference::Set(set),
            (Some(_), _) => {
                let message = format!("{}: two references, \"reference\" and \"against\"", path.display());
                return Err(Error::usage(message, "leave one of them out"));
            }
            (None, _) => {
                let message = format!("{}: there is nothing to hold points against", path.display());
                let help = "name settings, as in --reference transport.tolerance=0.002, or a picture with --against";
                return Err(Error::usage(message, help));
            }
        };
        let name = path.file_stem().map_or_else(|| "chart".to_owned(), |stem| stem.to_string_lossy().into_owned());
        let spec = Spec {
            title: if self.title.is_empty() { name.clone() } else { self.title },
            name,
            graph: self.graph,
            node: self.node,
            layer: self.layer,
            set: self.set,
            products,
            reference,
            objects: self.objects,
            blocks: self.blocks.unwrap_or(4),
            default: self.default,
            why: self.why,
            beside: self.beside,
            runs: self.runs.unwrap_or(1),
        };
        if spec.blocks == 0 || spec.runs == 0 {
            let message = format!("{}: blocks and runs are numbers from 1 up", path.display());
            return Err(Error::usage(message, "leave them out for blocks of 4 x 4 pixels and one run"));
        }
        if !spec.default.is_empty() && !spec.combinations().iter().any(|settings| spec.is_default(settings)) {
            let message = format!("{}: the default is not among what is swept", path.display());
            return Err(Error::usage(message, "add it to the sweep, so that it is measured"));
        }
        Ok(spec)
    }
}

/// A chart's file, or a recipe, of which nothing is swept yet.
fn written(path: &Path) -> Result<Written> {
    let text = std::fs::read_to_string(path)
        .map_err(|error| Error::file(path, format!("cannot be read: {error}"), "name a recipe, or a chart"))?;
    let is_chart = serde_json::from_str::<Json>(&text).is_ok_and(|json| json.get("chart").is_some());
    if !is_chart {
        return Ok(Written { chart: 1, graph: path.to_owned(), ..Written::default() });
    }
    let parsed = serde_path_to_error::deserialize::<_, Written>(&mut serde_json::Deserializer::from_str(&text));
    let mut written = parsed.map_err(|error| {
        let message = format!("{}: {}", error.path(), error.inner());
        Error::file(path, message, "a chart has graph, sweep, and reference or against; see the README")
    })?;
    if written.chart != 1 {
        let message = format!("a chart of version {}; this program reads version 1", written.chart);
        return Err(Error::file(path, message, "use a newer chiaro"));
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let beside = |file: &mut PathBuf| *file = folder.join(&*file);
    beside(&mut written.graph);
    written.objects.iter_mut().for_each(beside);
    written.against.iter_mut().for_each(|plate| beside(&mut plate.file));
    written.beside.values_mut().for_each(beside);
    Ok(written)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn product(list: &[(&str, &[i32])]) -> Product {
        let values = |values: &[i32]| values.iter().map(|value| json!(value)).collect();
        list.iter().map(|(name, list)| ((*name).to_owned(), values(list))).collect()
    }

    #[test]
    fn combinations_are_all() {
        let products = vec![product(&[("a.a", &[1, 2]), ("b.b", &[3, 4, 5])]), product(&[("b.b", &[6])])];
        let written = Written {
            sweep: Sweep::Several(products),
            reference: [("a.a".to_owned(), json!(9))].into(),
            default: [("b.b".to_owned(), json!(4))].into(),
            ..Written::default()
        };
        let spec = written.clone().checked(Path::new("x.json")).unwrap();
        let all = spec.combinations();
        let of = |name: &str| all.iter().map(|s| s.get(name).and_then(Json::as_i64)).collect::<Vec<_>>();
        assert_eq!(of("a.a"), [Some(1), Some(1), Some(1), Some(2), Some(2), Some(2), None]);
        assert_eq!(of("b.b"), [3, 4, 5, 3, 4, 5, 6].map(Some));
        assert_eq!(all.iter().filter(|settings| spec.is_default(settings)).count(), 2);
        let not_swept = Written { default: [("b.b".to_owned(), json!(7))].into(), ..written.clone() };
        assert!(not_swept.checked(Path::new("x.json")).is_err());
        let of_nothing = Written { sweep: Sweep::One(Product::new()), ..written.clone() };
        assert!(of_nothing.checked(Path::new("x.json")).is_err());
        let against_nothing = Written { reference: Settings::new(), ..written };
        assert!(against_nothing.checked(Path::new("x.json")).is_err());
    }
}
