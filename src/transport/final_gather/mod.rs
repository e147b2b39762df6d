//! The offline renderer (thesis 5.5.3): final gathering with irradiance caching [WRC88], refined until it is as good as
//! asked.
//!
//! ```text
//! view        what the camera sees, one sample of each pixel at a time; direct light there
//! placement   which pixels need a record of the cache
//! gatherer    light at places: rays over hemispheres (hemisphere), and photons (photons) that they can see; place: their sum
//! incident    light that leaves what these meet
//! source      edits of that light; bounces: what arrives there after more than one
//! crossing    edits on the way to a place: procedural (transit) and sampled (sampled, edited_view, pieces); eye: after that
//! cache       records; what they say of other places: light_cache
//! growth      more records, more rays
//! estimate    how far the picture is from the truth, and where rays help
//! film        passes -> layers
//! reflections light that glossy surfaces send to the eye, gathered and cached in the same way
//! light_map   one kind of light over the picture, refined
//! maps        both kinds together
//! render      all of these, end to end
//! ```

pub mod bounces;
pub mod cache;
pub mod crossing;
mod edited_view;
pub mod estimate;
mod eye;
pub mod film;
pub mod gatherer;
pub mod growth;
pub mod hemisphere;
pub mod incident;
pub mod light_map;
pub mod maps;
pub mod photons;
mod pieces;
mod place;
pub mod placement;
pub mod reflections;
pub mod render;
pub mod sampled;
pub mod source;
pub mod transit;
pub mod view;

pub use bounces::Bounces;
pub use crossing::Crossing;
pub use gatherer::Gatherer;
pub use incident::Incident;
pub use render::{Light, Renderer, Settings};
pub use source::SourceEdits;
pub use view::Seen;
