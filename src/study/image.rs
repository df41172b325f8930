//! The colour, or a layer, of a picture as interleaved RGB.

use std::path::Path;

use super::RgbView;
use crate::desc::{Error, Result};
use crate::load::{Picture, read_picture};

/// Interleaved scene-linear RGB, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Three values for each pixel.
    pub rgb: Vec<f32>,
}

impl Image {
    /// The colour of a picture (`R G B`, or `Y` three times), or its layer of
    /// that name (`error.R …`, `N.X …`).
    #[must_use]
    pub fn of(picture: &Picture, layer: Option<&str>) -> Option<Image> {
        let three = |names: [&str; 3]| -> Option<Vec<&[f32]>> {
            let name = |c: &str| layer.map_or_else(|| c.to_owned(), |l| format!("{l}.{c}"));
            names.iter().map(|c| picture.channel(&name(c))).collect()
        };
        let vector = || three(["X", "Y", "Z"]).filter(|_| layer.is_some());
        let grey = || if layer.is_none() { picture.channel("Y").map(|y| vec![y; 3]) } else { None };
        let channels = three(["R", "G", "B"]).or_else(vector).or_else(grey)?;
        let rgb = (0..channels[0].len()).flat_map(|i| channels.iter().map(move |c| c[i])).collect();
        Some(Image { width: picture.width as usize, height: picture.height as usize, rgb })
    }

    /// Reads a picture and takes its colour.
    ///
    /// # Errors
    /// What cannot be read, or has no colour.
    pub fn read(path: &Path) -> Result<(Picture, Image)> {
        let picture = read_picture(path)?;
        let image = Image::of(&picture, None).ok_or_else(|| {
            Error::new(format!("`{}` has no channels R, G, B", path.display())).hint("nor Y")
        })?;
        Ok((picture, image))
    }

    /// The picture as the metrics take it.
    ///
    /// # Errors
    /// When it has no pixels.
    pub fn view(&self) -> Result<RgbView<'_>> {
        RgbView::new(self.width, self.height, &self.rgb)
    }
}
