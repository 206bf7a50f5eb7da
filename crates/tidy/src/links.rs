//! Links between pages: a relative link of a page of Markdown leads to a file or directory, and to a heading of it.
//!
//! Input: a tree, and whether a path is in the repository, also one that the tree does not read. Output: findings.
//! Links with a scheme or a path of Rust (`https:`, `crate::`) are not followed; code blocks have no links.

use crate::Finding;
use crate::tree::Tree;

/// Links that lead nowhere.
pub fn broken(tree: &Tree, exists: impl Fn(&str) -> bool) -> Vec<Finding> {
    let mut findings = Vec::new();
    for page in tree.files.iter().filter(|file| file.path.ends_with(".md")) {
        for (line, link) in lines(&page.text).flat_map(|(line, text)| targets(text).map(move |link| (line, link))) {
            let (path, heading) = link.split_once('#').unwrap_or((link, ""));
            let target = if path.is_empty() { Some(page.path.clone()) } else { joined(&page.path, path) };
            let Some(target) = target.filter(|target| tree.file(target).is_some() || exists(target)) else {
                findings.push(Finding::new(&page.path, line, format!("there is no `{link}`")));
                continue;
            };
            let other = tree.file(&target).filter(|file| file.path.ends_with(".md") && !heading.is_empty());
            if other.is_some_and(|other| headings(&other.text).all(|it| it != heading)) {
                findings.push(Finding::new(&page.path, line, format!("`{target}` has no heading `{heading}`")));
            }
        }
    }
    findings
}

/// Lines with their numbers, without those of code blocks.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut is_code = false;
    text.lines().enumerate().filter_map(move |(number, line)| {
        let is_fence = line.trim_start().starts_with("```");
        is_code ^= is_fence;
        (!is_code && !is_fence).then_some((number + 1, line))
    })
}

/// Targets of the links in a line that name a file or a heading.
fn targets(line: &str) -> impl Iterator<Item = &str> {
    let ends = line.split("](").skip(1);
    ends.filter_map(|rest| rest.split_once(')')).map(|(target, _)| target).filter(|target| !target.contains([':', ' ']))
}

/// A path relative to a page, from the root; `None` above the root.
fn joined(page: &str, path: &str) -> Option<String> {
    let mut parts: Vec<&str> = page.split('/').collect();
    parts.pop();
    for part in path.split('/') {
        match part {
            "" | "." => {}
            ".." => drop(parts.pop()?),
            _ => parts.push(part),
        }
    }
    Some(parts.join("/"))
}

/// The anchors of the headings of a page, as GitHub makes them.
fn headings(text: &str) -> impl Iterator<Item = String> {
    let titles = lines(text).filter_map(|(_, line)| line.strip_prefix('#')).map(|line| line.trim_start_matches('#'));
    let kept = |c: char| match c {
        ' ' => Some('-'),
        '-' | '_' => Some(c),
        _ => c.is_alphanumeric().then_some(c),
    };
    titles.map(move |title| title.trim().to_lowercase().chars().filter_map(kept).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::File;

    // covers: tree
    #[test]
    fn a_link_without_its_file_or_heading_is_named_with_its_line() {
        let page = "# A page\n[one](b/c.md) [two](b/d.md)\n[itself](#a-page) [not](#a-pag)\n```\n[code](x.md)\n```\n";
        let other =
            "# C\n## The `bars`, 2 of them\n[up](../a.md#a-page) [out](../../a.md) <https://a> [rust](crate::A)\n";
        let links = "[right](b/c.md#the-bars-2-of-them) [wrong](b/c.md#bars) [image](b/ring.svg) [folder](b)\n";
        let files = vec![File::new("a.md", page), File::new("b/c.md", other), File::new("e.md", links)];
        let found = broken(&Tree { files }, |path| matches!(path, "b" | "b/ring.svg"));
        let found: Vec<String> = found.iter().map(ToString::to_string).collect();
        let expected = [
            "a.md:2: there is no `b/d.md`",
            "a.md:3: `a.md` has no heading `a-pag`",
            "b/c.md:3: there is no `../../a.md`",
            "e.md:1: `b/c.md` has no heading `bars`",
        ];
        assert_eq!(found, expected);
    }
}
