//! What an ENI cannot express, as an error of the network file: with the line of the key.

use toml::de::DeTable;

use super::error::{Fault, NetworkError, Step, path_text, short};
use super::read::placed;
use crate::export::ExportError;

impl NetworkError {
    /// The error of an export as an error of the file from whose text it was made; `file` is its name in messages.
    pub fn of_export(file: &str, text: &str, error: &ExportError) -> NetworkError {
        let path = path(error);
        let message = match error.key.is_empty() {
            true => format!("{}: {}", error.what, error.reason),
            false => error.reason.clone(),
        };
        if let Ok(tree) = DeTable::parse(text) {
            return placed(file, text, tree.get_ref(), &Fault { path, message });
        }
        let subdevice = error.subdevice.as_ref().map(|(_, name)| short(name)).unwrap_or_default();
        NetworkError { file: file.to_owned(), line: None, key: path_text(&path), subdevice, message }
    }
}

/// The path of the key, from the root.
fn path(error: &ExportError) -> Vec<Step> {
    let mut path: Vec<Step> = Vec::new();
    if let Some((index, _)) = &error.subdevice {
        path.extend(["subdevice".into(), Step::from(*index)]);
    }
    for part in error.key.split('.').filter(|part| !part.is_empty()) {
        let (key, index) = part.strip_suffix(']').and_then(|part| part.split_once('[')).unwrap_or((part, ""));
        path.push(key.into());
        path.extend(index.parse::<usize>().ok().map(Step::from));
    }
    path
}
