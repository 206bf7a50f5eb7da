//! The checked files: all files of text below `.ci/`, `ci/`, `crates/`, `docs/`, `examples/` and `fuzz/`, and some in
//! the root, read once.
//!
//! Input: the root of the repository. Output: paths and texts, sorted. Build output is left out.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// One file of text.
#[derive(Clone, Debug)]
pub struct File {
    /// Relative to the root, with `/` between its parts.
    pub path: String,
    /// Its text.
    pub text: String,
}

impl File {
    /// A file that exists only in memory.
    pub fn new(path: &str, text: &str) -> File {
        File { path: path.to_owned(), text: text.to_owned() }
    }

    /// Whether it is Rust source.
    pub fn is_rust(&self) -> bool {
        self.path.ends_with(".rs")
    }
}

/// All checked files.
#[derive(Clone, Debug, Default)]
pub struct Tree {
    /// Sorted by path.
    pub files: Vec<File>,
}

/// Directories of the repository that are read.
const ROOTS: [&str; 7] = [".ci", "ci", "crates", "docs", "examples", "fuzz", "packaging"];

/// Files at the root that are read.
const AT_THE_ROOT: [&str; 7] =
    ["CHANGELOG.md", "CONTRIBUTING.md", "Cargo.toml", "README.md", "SECURITY.md", "deny.toml", "rustfmt.toml"];

/// Kinds of files that are read.
const EXTENSIONS: [&str; 9] = ["c", "h", "map", "md", "py", "rs", "sh", "toml", "txt"];

/// Scripts, and directories whose files without an extension are scripts or Makefiles, which are read too.
const SCRIPTS: [&str; 5] = [".ci", "ci", "crates/ffi/install", "examples", "packaging"];

/// All files of this directory are text and are read, whatever their extension is.
const PACKAGING: &str = "packaging";

impl Tree {
    /// Reads the repository that contains this crate.
    pub fn of_this_repository() -> io::Result<Tree> {
        Tree::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."))
    }

    /// Reads the repository at `root`.
    pub fn read(root: &Path) -> io::Result<Tree> {
        let mut files = Vec::new();
        for directory in ROOTS {
            let path = root.join(directory);
            if path.is_dir() {
                collect(root, &path, &mut files)?;
            }
        }
        for path in AT_THE_ROOT {
            if let Ok(text) = fs::read_to_string(root.join(path)) {
                files.push(File::new(path, &text));
            }
        }
        files.sort_by(|a, b| a.path.cmp(&b.path));
        Ok(Tree { files })
    }

    /// The file with this path.
    pub fn file(&self, path: &str) -> Option<&File> {
        self.files.iter().find(|file| file.path == path)
    }

    /// All Rust sources.
    pub fn rust(&self) -> impl Iterator<Item = &File> {
        self.files.iter().filter(|file| file.is_rust())
    }
}

fn collect(root: &Path, directory: &Path, files: &mut Vec<File>) -> io::Result<()> {
    for entry in fs::read_dir(directory)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() {
            if !name.starts_with("target") && !name.starts_with('.') && name != "corpus" {
                collect(root, &path, files)?;
            }
        } else if is_read(root, &path) {
            files.push(File { path: relative(root, &path), text: fs::read_to_string(&path)? });
        }
    }
    Ok(())
}

fn is_read(root: &Path, path: &Path) -> bool {
    match path.extension() {
        Some(extension) => EXTENSIONS.iter().any(|known| extension == *known) || path.starts_with(root.join(PACKAGING)),
        None => SCRIPTS.iter().any(|directory| path.starts_with(root.join(directory))),
    }
}

fn relative(root: &Path, path: &Path) -> String {
    let path: PathBuf = path.strip_prefix(root).unwrap_or(path).to_path_buf();
    path.components().map(|c| c.as_os_str().to_string_lossy().into_owned()).collect::<Vec<_>>().join("/")
}
