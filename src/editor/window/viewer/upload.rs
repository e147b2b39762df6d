//! Developed pictures go to the graphics card.

use super::Viewer;
use crate::editor::develop::{Developed, Pixels};
use egui::{ColorImage, Context, TextureOptions};

impl Viewer {
    pub(super) fn upload(&mut self, developed: &Developed, ctx: &Context) {
        self.step = developed.picture.step;
        let pictures = [Some(&developed.picture), developed.other.as_ref()];
        for (slot, (pixels, name)) in pictures.into_iter().zip(["A", "B"]).enumerate() {
            let Some(pixels) = pixels else {
                self.textures[slot] = None;
                continue;
            };
            let options = TextureOptions { magnification: egui::TextureFilter::Nearest, ..TextureOptions::LINEAR };
            let image = colours(pixels);
            match &mut self.textures[slot] {
                Some(texture) => texture.set(image, options),
                None => {
                    let name = format!("viewer {} {name}", self.number);
                    self.textures[slot] = Some(ctx.load_texture(name, image, options));
                }
            }
        }
    }
}

fn colours(pixels: &Pixels) -> ColorImage {
    ColorImage::from_rgba_premultiplied([pixels.width, pixels.height], pixels.data.as_flattened())
}
