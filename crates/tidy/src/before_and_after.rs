//! The table of figures before and after the model of the segment, in `docs/performance.md`: none is more than a
//! hundredth above the one before.
//!
//! Input: a tree. Output: findings. The figures themselves are printed by the commands that the table names.

use crate::Finding;
use crate::tree::Tree;

/// The page, and the heading above the table.
const PAGE: &str = "docs/performance.md";
const HEADING: &str = "## Before and after the model of the segment\n";
/// Columns of a row: figure, before, now, command.
const COLUMNS: usize = 4;

/// Rows whose figures grew by more than a hundredth, and what of the table is not there.
pub fn grown(tree: &Tree) -> Vec<Finding> {
    let Some((_, section)) = tree.file(PAGE).and_then(|page| page.text.split_once(HEADING)) else {
        return vec![Finding::new(PAGE, 0, format!("there is no heading {HEADING:?}"))];
    };
    let section = section.split("\n## ").next().unwrap_or_default();
    let rows: Vec<&str> = section.lines().filter(|line| line.starts_with('|')).skip(2).collect();
    if rows.is_empty() {
        return vec![Finding::new(PAGE, 0, "the table of figures before and after has no rows")];
    }
    let finding = |text: String| Finding::new(PAGE, 0, text);
    rows.into_iter().filter_map(|row| judge(row).err().map(finding)).collect()
}

/// A row: each figure of `now` against the one before in the same place.
fn judge(row: &str) -> Result<(), String> {
    let columns: Vec<&str> = row.trim_matches('|').split('|').map(str::trim).collect();
    let [what, before, now, _] = columns[..] else {
        return Err(format!("{row}: {COLUMNS} columns were expected, not {}", columns.len()));
    };
    let (before, now) = (numbers(before), numbers(now));
    if before.is_empty() || before.len() != now.len() {
        return Err(format!("{what}: as many figures before as now were expected, not {before:?} and {now:?}"));
    }
    match before.iter().zip(&now).find(|(before, now)| **now > **before * 1.01) {
        Some((before, now)) => Err(format!("{what}: {now} is more than a hundredth above {before}")),
        None => Ok(()),
    }
}

/// The numbers of a text outside of parentheses; `1,244` is one number.
fn numbers(text: &str) -> Vec<f64> {
    let outside = text.split('(').map(|part| part.rsplit(')').next().unwrap_or_default());
    let joined = outside.collect::<Vec<_>>().join(" ").replace(',', "");
    joined.split(|it: char| !(it.is_ascii_digit() || it == '.')).filter_map(|word| word.parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::File;

    fn found(rows: &str) -> Vec<String> {
        let text = format!("{HEADING}\nText.\n\n| a | b | c | d |\n|---|---|---|---|\n{rows}\n## Next\n\n| 1 |\n");
        let tree = Tree { files: vec![File::new(PAGE, &text)] };
        grown(&tree).into_iter().map(|finding| finding.text).collect()
    }

    #[test]
    fn a_figure_that_grew_by_more_than_a_hundredth_is_found() {
        assert_eq!(found("| x | 1,244; 10.0 ms | 1,250 and 9 ms (-10 %) | `y` |"), [""; 0]);
        assert_eq!(found("| x | 100; 10 | 99; 10.2 | `y` |"), ["x: 10.2 is more than a hundredth above 10"]);
    }

    #[test]
    fn rows_without_figures_and_a_table_without_rows_are_found() {
        assert_eq!(found("").len(), 1);
        assert_eq!(found("| x | 100 | now 99; 98 | `y` |\n| x | quick | slow | `y` |\n| x | 1 | 1 |").len(), 3);
        assert_eq!(grown(&Tree { files: vec![File::new(PAGE, "# A")] }).len(), 1);
    }
}
