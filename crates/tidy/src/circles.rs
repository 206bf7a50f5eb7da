//! Checks that files of a crate name each other without circles.
//!
//! Input: the [`Arrows`] of a crate. Output: its circles (sets of files that all reach each other) and its longest
//! chain: the number of files that a reader may have to open, one after the other, to understand the first one.

use std::collections::{BTreeMap, BTreeSet};

use crate::Finding;
use crate::arrows::{self, Arrows};
use crate::known::Counts;
use crate::tree::Tree;

/// The crates of a repository, by their directories.
pub fn crates(tree: &Tree) -> Vec<String> {
    let name = |path: &str| Some(path.strip_prefix("crates/")?.strip_suffix("/Cargo.toml")?.to_owned());
    tree.files.iter().filter_map(|file| name(&file.path)).filter(|name| !name.contains('/')).collect()
}

/// Each file that is part of a circle, with the number of files in it.
pub fn sizes(tree: &Tree) -> Result<Counts, Finding> {
    let mut sizes = Counts::new();
    for name in crates(tree) {
        for circle in Graph::new(&arrows::of_crate(tree, &name)?).circles() {
            sizes.extend(circle.iter().map(|file| ((*file).to_owned(), circle.len())));
        }
    }
    Ok(sizes)
}

/// The files of a crate and the arrows between them.
pub struct Graph {
    files: Vec<String>,
    to: Vec<Vec<usize>>,
}

impl Graph {
    /// The graph of these arrows.
    pub fn new(arrows: &Arrows) -> Graph {
        let files: BTreeSet<&String> = arrows.keys().flat_map(|(from, to)| [from, to]).collect();
        let number: BTreeMap<&String, usize> = files.iter().enumerate().map(|(at, file)| (*file, at)).collect();
        let mut to = vec![Vec::new(); files.len()];
        for (from, other) in arrows.keys() {
            to[number[from]].push(number[other]);
        }
        Graph { files: files.into_iter().cloned().collect(), to }
    }

    /// Sets of files that all reach each other, the files of each in their order.
    pub fn circles(&self) -> Vec<Vec<&str>> {
        let groups = self.groups().into_iter().filter(|group| group.len() > 1);
        groups.map(|group| group.into_iter().map(|file| self.files[file].as_str()).collect()).collect()
    }

    /// The longest path along arrows that visits no file twice; a circle counts as one position with all its files.
    pub fn longest_chain(&self) -> Vec<&str> {
        // Groups are ordered from the lowest.
        let groups = self.groups();
        let mut group_of = vec![0; self.files.len()];
        for (at, group) in groups.iter().enumerate() {
            group.iter().for_each(|file| group_of[*file] = at);
        }
        let mut best: Vec<(usize, Option<usize>)> = Vec::new();
        for (at, group) in groups.iter().enumerate() {
            let below = group.iter().flat_map(|file| &self.to[*file]).map(|to| group_of[*to]).filter(|to| *to != at);
            let next = below.max_by_key(|to| best[*to].0);
            best.push((group.len() + next.map_or(0, |next| best[next].0), next));
        }
        let mut at = (0..groups.len()).max_by_key(|at| best[*at].0);
        let mut chain = Vec::new();
        while let Some(group) = at {
            chain.extend(groups[group].iter().map(|file| self.files[*file].as_str()));
            at = best[group].1;
        }
        chain
    }

    /// Strongly connected components, each after those that it reaches (Tarjan).
    fn groups(&self) -> Vec<Vec<usize>> {
        let mut search = Search {
            graph: self,
            next: 0,
            number: vec![None; self.files.len()],
            lowest: vec![0; self.files.len()],
            open: Vec::new(),
            groups: Vec::new(),
        };
        for file in 0..self.files.len() {
            if search.number[file].is_none() {
                search.visit(file);
            }
        }
        search.groups
    }
}

struct Search<'a> {
    graph: &'a Graph,
    next: usize,
    number: Vec<Option<usize>>,
    lowest: Vec<usize>,
    open: Vec<usize>,
    groups: Vec<Vec<usize>>,
}

impl Search<'_> {
    fn visit(&mut self, file: usize) {
        let own = self.next;
        self.next += 1;
        self.number[file] = Some(own);
        self.lowest[file] = own;
        self.open.push(file);
        for to in self.graph.to[file].clone() {
            match self.number[to] {
                None => {
                    self.visit(to);
                    self.lowest[file] = self.lowest[file].min(self.lowest[to]);
                }
                Some(number) if self.open.contains(&to) => self.lowest[file] = self.lowest[file].min(number),
                Some(_) => {}
            }
        }
        if self.lowest[file] == own {
            let start = self.open.iter().position(|open| *open == file).unwrap_or(0);
            let mut group = self.open.split_off(start);
            group.sort_unstable();
            self.groups.push(group);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arrows::Arrow;

    fn graph(arrows: &[(&str, &str)]) -> Graph {
        let arrow = || Arrow { path: String::new(), line: 1 };
        Graph::new(&arrows.iter().map(|(from, to)| (((*from).to_owned(), (*to).to_owned()), arrow())).collect())
    }

    #[test]
    fn a_tree_has_no_circle_and_its_depth_as_chain() {
        let graph = graph(&[("a", "b"), ("a", "c"), ("b", "d"), ("c", "d"), ("x", "d")]);
        assert!(graph.circles().is_empty());
        let chain = graph.longest_chain();
        assert!(chain.len() == 3 && chain[0] == "a" && chain[2] == "d", "{chain:?}");
    }

    #[test]
    fn files_that_reach_each_other_are_one_circle() {
        let graph = graph(&[("a", "b"), ("b", "c"), ("c", "a"), ("c", "d"), ("d", "e"), ("e", "d"), ("top", "a")]);
        assert_eq!(graph.circles(), [vec!["d", "e"], vec!["a", "b", "c"]]);
        assert_eq!(graph.longest_chain(), ["top", "a", "b", "c", "d", "e"]);
    }

    #[test]
    fn each_file_of_a_circle_has_its_size() {
        let file = |name: &str, text: &str| crate::tree::File::new(&format!("crates/x/{name}"), text);
        let files = vec![
            file("Cargo.toml", ""),
            file("src/a.rs", "use crate::b::B; pub struct A;"),
            file("src/b.rs", "use crate::a::A; pub struct B;"),
            file("src/lib.rs", "mod a; mod b; fn f(_: a::A) {}"),
        ];
        let expected = [("crates/x/src/a.rs", 2), ("crates/x/src/b.rs", 2)];
        assert_eq!(sizes(&Tree { files }), Ok(expected.map(|(file, size)| (file.to_owned(), size)).into()));
    }
}
