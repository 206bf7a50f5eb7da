//! Checks that `docs/capabilities.md` is honest, tests cover every row with state "works" or "partly", and that
//! `docs/FEATURES.md`, its short form, is read in two minutes.
//!
//! Input: a tree. Output: findings. A row of the former is `| [capability](feature-tests.md#id) | state | limits |`; a
//! test covers it by its id on a `// covers:` line. [`crate::evidence`] lists the tests of each row.

use std::collections::{BTreeMap, BTreeSet};

use crate::Finding;
use crate::covers;
use crate::tree::Tree;

/// The page with the table.
pub(crate) const PAGE: &str = "docs/capabilities.md";
/// Its short form.
const SHORT: &str = "docs/FEATURES.md";
/// Values of the second column; the last one needs no test.
const STATES: [&str; 3] = ["works", "partly", "not yet"];
/// Section of what does not exist yet.
const NOT_YET: &str = "not-yet";
/// Maximum number of rows.
const MAX_ROWS: usize = 120;
/// Maximum number of words of the short form outside of links: two minutes at 240 words a minute.
const MAX_SHORT_WORDS: usize = 480;
/// Maximum length of a capability with its limits, without the link.
const MAX_WORDS: usize = 170;

/// A row of the table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    /// Its id in `covers` lines; empty if the row has none.
    pub id: String,
    /// Capability.
    pub capability: String,
    /// One of the states.
    pub state: String,
    /// Limits and measured ranges.
    pub limits: String,
    /// Line on the page.
    pub line: usize,
}

/// All rows of a page; an error for each invalid row.
pub(crate) fn rows(text: &str) -> Vec<Result<Row, Finding>> {
    let mut rows = Vec::new();
    let mut in_table = false;
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        let cells: Vec<&str> = line
            .strip_prefix('|')
            .map_or(Vec::new(), |row| row.strip_suffix('|').unwrap_or(row).split('|').map(str::trim).collect());
        if cells.is_empty() {
            in_table = false;
        } else if cells.iter().all(|cell| cell.chars().all(|c| matches!(c, '-' | ':'))) {
            in_table = true;
        } else if in_table {
            rows.push(row(&cells, number + 1));
        }
    }
    rows
}

fn row(cells: &[&str], line: usize) -> Result<Row, Finding> {
    let [first, state, limits] = cells else {
        return Err(Finding::new(PAGE, line, format!("a row has three cells, this one {}", cells.len())));
    };
    let linked = first.strip_prefix('[').and_then(|rest| rest.split_once("](feature-tests.md#"));
    let (capability, id) = linked.map_or((*first, ""), |(capability, id)| (capability, id.trim_end_matches(')')));
    let [capability, id, state, limits] = [capability, id, state, limits].map(str::to_owned);
    Ok(Row { id, capability, state, limits, line })
}

/// Findings about the short form: it is too long, a row leads to no section, a section of the page is missing in it, or
/// the state of a row is not that of the capabilities it stands for.
///
/// These are in a comment in the row: `<!-- ring-cut ring-flap -->`. The row works if all of them work.
pub fn short_form(tree: &Tree) -> Vec<Finding> {
    let (Some(short), Some(page)) = (tree.file(SHORT), tree.file(PAGE)) else {
        return vec![Finding::new(SHORT, 0, "is missing, or the page behind it")];
    };
    let sections: BTreeSet<String> =
        page.text.lines().filter_map(|line| line.strip_prefix("## ")).map(anchor).collect();
    let (mut findings, mut named, mut words) = (Vec::new(), BTreeSet::new(), 0);
    let capabilities = capabilities(&page.text);
    let mut shown: BTreeSet<&str> = BTreeSet::new();
    for (number, line) in short.text.lines().enumerate() {
        let (line, ids) = without_comment(line);
        let (link, rest) = match line.split_once("](capabilities.md#") {
            Some((before, after)) => (after.split_once(')'), before),
            None => (None, line.as_str()),
        };
        let row = link.map(|(section, cells)| (section, cells.split('|').map(str::trim).collect::<Vec<_>>()));
        words += words_of(rest) + link.map_or(0, |(_, cells)| words_of(cells));
        let Some((section, cells)) = row else { continue };
        let mut found = |text: String| findings.push(Finding::new(SHORT, number + 1, text));
        if !sections.contains(section) {
            found(format!("{PAGE} has no section #{section}"));
        }
        let mut state = if section == NOT_YET { STATES[2] } else { STATES[0] };
        for id in ids {
            match capabilities.get_key_value(id) {
                Some((id, (of, row))) if of == section => {
                    shown.insert(id);
                    state = if row == STATES[0] { state } else { STATES[1] };
                }
                _ => found(format!("#{section} of {PAGE} has no row `{id}`")),
            }
        }
        if cells.get(1) != Some(&state) {
            found(format!("the state is `{state}`, as {PAGE} has it"));
        }
        named.insert(section.to_owned());
    }
    let hidden = capabilities.keys().filter(|id| !shown.contains(id.as_str()));
    findings.extend(hidden.map(|id| Finding::new(SHORT, 0, format!("no row stands for `{id}`"))));
    let missing = sections.difference(&named);
    findings.extend(missing.map(|section| Finding::new(SHORT, 0, format!("no row leads to #{section}"))));
    if words > MAX_SHORT_WORDS {
        findings.push(Finding::new(SHORT, 0, format!("{words} words, more than {MAX_SHORT_WORDS}")));
    }
    findings
}

/// Id of each capability that has one, with the anchor of its section and its state.
fn capabilities(page: &str) -> BTreeMap<String, (String, String)> {
    let mut found = BTreeMap::new();
    for part in page.split("\n## ").skip(1) {
        let section = anchor(part.lines().next().unwrap_or_default());
        for row in rows(part).into_iter().flatten().filter(|row| !row.id.is_empty()) {
            found.insert(row.id, (section.clone(), row.state));
        }
    }
    found
}

/// A line without the comment in it, and the words of that.
fn without_comment(line: &str) -> (String, Vec<&str>) {
    let comment = line.split_once("<!--").and_then(|(before, rest)| Some((before, rest.split_once("-->")?)));
    match comment {
        Some((before, (ids, after))) => (format!("{before}{after}"), ids.split_whitespace().collect()),
        None => (line.to_owned(), Vec::new()),
    }
}

/// Words of a text, without signs that stand alone.
fn words_of(text: &str) -> usize {
    text.split_whitespace().filter(|word| word.contains(char::is_alphanumeric)).count()
}

/// The anchor of a heading.
fn anchor(heading: &str) -> String {
    let kept = heading.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-'));
    kept.map(|c| if c == ' ' { '-' } else { c.to_ascii_lowercase() }).collect()
}

/// Ids of all rows.
pub fn ids(tree: &Tree) -> BTreeSet<String> {
    let text = tree.file(PAGE).map_or("", |page| &page.text);
    rows(text).into_iter().flatten().map(|row| row.id).filter(|id| !id.is_empty()).collect()
}

/// Rows without a test, with an unknown state, too long or too many.
pub fn faults(tree: &Tree) -> Vec<Finding> {
    let Some(page) = tree.file(PAGE) else {
        return vec![Finding::new(PAGE, 0, "is missing")];
    };
    let tests = covers::all(tree);
    let covered: BTreeSet<&String> = tests.iter().flat_map(|test| &test.covers).collect();
    let rows = rows(&page.text);
    let mut findings = Vec::new();
    if rows.len() > MAX_ROWS {
        findings.push(Finding::new(PAGE, 0, format!("{} rows, more than {MAX_ROWS}: join some", rows.len())));
    }
    let mut seen = BTreeSet::new();
    for row in rows {
        match row {
            Ok(row) => {
                if !row.id.is_empty() && !seen.insert(row.id.clone()) {
                    findings.push(Finding::new(PAGE, row.line, format!("`{}` has a row already", row.id)));
                }
                findings.extend(faults_of(&row, &covered).into_iter().map(|text| Finding::new(PAGE, row.line, text)));
            }
            Err(finding) => findings.push(finding),
        }
    }
    findings
}

fn faults_of(row: &Row, covered: &BTreeSet<&String>) -> Vec<String> {
    let mut faults = Vec::new();
    let claims = row.state != STATES[2];
    if !STATES.contains(&row.state.as_str()) {
        faults.push(format!("state is one of {STATES:?}, got `{}`", row.state));
    }
    if claims && row.id.is_empty() {
        faults.push("the capability is no link `[...](feature-tests.md#id)`".to_owned());
    } else if claims && !covered.contains(&row.id) {
        faults.push(format!("no test covers `{}`: write `// covers: {}` above those that do", row.id, row.id));
    }
    let words = row.capability.len() + row.limits.len();
    if words > MAX_WORDS {
        faults
            .push(format!("{words} characters, more than {MAX_WORDS}: limits at length go to the page of the matter"));
    }
    faults
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::File;

    fn tree(rows: &str) -> Tree {
        let page = format!("| capability | state | limits |\n|---|---|---|\n{rows}\n");
        let source = "// covers: ring-cut\n#[test]\nfn shown() {}\n";
        Tree { files: vec![File::new(PAGE, &page), File::new("crates/a/src/a.rs", source)] }
    }

    #[test]
    fn a_row_passes_when_a_test_covers_it() {
        assert!(faults(&tree("| [it works](feature-tests.md#ring-cut) | works | at most one |")).is_empty());
        assert!(faults(&tree("| it will | not yet | |")).is_empty());
        assert!(ids(&tree("| [it works](feature-tests.md#ring-cut) | works | |")).contains("ring-cut"));
    }

    #[test]
    fn a_row_whose_claim_is_not_covered_is_found() {
        let long = format!("| [{}](feature-tests.md#ring-cut) | works | |", "a".repeat(171));
        let twice = "| [a](feature-tests.md#ring-cut) | works | |\n".repeat(2);
        let wrong = [
            "| [it works](feature-tests.md#gone) | works | |",
            "| it works | partly | |",
            "| [it works](feature-tests.md#ring-cut) | maybe | |",
            "| [it works](feature-tests.md#ring-cut) | works |",
            &long,
            &twice,
        ];
        for rows in wrong {
            assert_eq!(faults(&tree(rows)).len(), 1, "{rows}");
        }
        assert_eq!(faults(&tree(&"| it will | not yet | |\n".repeat(121))).len(), 1);
    }

    #[test]
    fn a_missing_page_is_found() {
        assert_eq!(faults(&Tree::default()).len(), 1);
    }

    #[test]
    fn the_short_form_leads_to_each_section_with_few_words_and_its_states() {
        let head = "| capability | state | limits |\n|---|---|---|\n";
        let row = |id: &str, state: &str| format!("| [It](feature-tests.md#{id}) | {state} | |\n");
        let clocks = format!("{head}{}{}", row("lock", "works"), row("ring", "partly"));
        let page = format!("# Capabilities\n\n## Clocks (all)\n\n{clocks}\n## Not yet\n");
        let short = |text: &str| {
            short_form(&Tree { files: vec![File::new(PAGE, &page), File::new(SHORT, text)] })
                .iter()
                .map(ToString::to_string)
                .collect::<Vec<_>>()
        };
        let good = "| [A](capabilities.md#clocks-all) | works | <!-- lock --> |\n\
                    | [B](capabilities.md#clocks-all) | partly | <!-- lock ring --> |\n\
                    | [C](capabilities.md#not-yet) | not yet | |\n";
        assert_eq!(short(good), [""; 0]);
        let wrong = [
            ("no such section, and none leads to the other one", good.replace("#not-yet", "#other"), 3),
            ("another state", good.replace("partly", "works"), 1),
            ("a capability without a row", good.replace("lock ring", "lock").replace("partly", "works"), 1),
            ("an unknown capability", good.replace("lock ring", "lock ring other"), 1),
            ("too many words", format!("{good}{}", "word ".repeat(480)), 1),
        ];
        for (what, text, count) in wrong {
            assert_eq!(short(&text).len(), count, "{what}: {:?}", short(&text));
        }
    }
}
