//! Pictures in SVG: the file, and what every picture begins and ends with.

use std::fmt;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::failure::Failure;

/// What a picture ends with.
pub const END: &str = "</svg>\n";

/// What a picture of this width and height begins with; the title is above its left margin.
pub fn begin([width, height]: [f64; 2], margin: f64, title: &str) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" \
         font-size=\"11\" fill=\"#444\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
         <text x=\"{margin}\" y=\"20\" font-size=\"13\">{title}</text>\n"
    )
}

/// The file for a picture, made before anything is measured.
#[derive(Debug)]
pub struct Picture {
    path: PathBuf,
    file: File,
}

impl fmt::Display for Picture {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.path.display())
    }
}

impl Picture {
    /// Makes the file.
    pub fn create(path: &Path) -> Result<Picture, Failure> {
        let file = File::create(path).map_err(|error| Failure::new(failed(path, &error)))?;
        Ok(Picture { path: path.to_owned(), file })
    }

    /// Writes the picture; the reason where that is not possible.
    pub fn draw(&mut self, picture: &str) -> Result<(), String> {
        self.file.write_all(picture.as_bytes()).map_err(|error| failed(&self.path, &error))
    }
}

fn failed(path: &Path, error: &io::Error) -> String {
    format!("{} cannot be written: {error}", path.display())
}
