//! The rules, applied to this repository.

use tidy::known::Known;
use tidy::rules::RULES;
use tidy::tree::Tree;
use tidy::{
    Finding, before_and_after, coverage, covers, crates, decisions, deny, dependencies, engine_lines, errors, evidence,
    explorers, features, files, handed_on, interface, links, mailboxes, modules, non_exhaustive, paths, protocol,
    publishing, reports, safety, sources, toolchain, words,
};

fn tree() -> Tree {
    Tree::of_this_repository().expect("the repository can be read")
}

fn none(findings: Vec<Finding>) {
    let lines: Vec<String> = findings.iter().map(ToString::to_string).collect();
    assert!(lines.is_empty(), "\n{}\n", lines.join("\n"));
}

#[test]
fn the_tree_is_found() {
    let tree = tree();
    assert!(tree.file("crates/wire/src/lib.rs").is_some() && tree.file("docs/FEATURES.md").is_some());
}

#[test]
fn no_source_is_too_long() {
    let tree = tree();
    for finding in files::nearly_too_long(&tree) {
        println!("warning: {finding}");
    }
    none(files::too_long(&tree));
}

#[test]
fn every_name_describes_its_content() {
    none(files::empty_names(&tree()));
}

#[test]
fn every_source_opens_with_its_purpose() {
    none(files::without_opening_comment(&tree()));
}

#[test]
fn nothing_is_unfinished() {
    none(files::unfinished(&tree()));
}

// covers: tree
#[test]
fn crates_depend_on_each_other_as_the_map_says() {
    none(crates::forbidden_arrows(&tree()));
}

// covers: library
#[test]
fn an_application_on_interfaces_takes_in_few_crates() {
    for features in dependencies::FEATURE_SETS {
        let tree = dependencies::cargo_tree(features).expect("cargo tree works");
        let (others, ours) = dependencies::crates_in(&tree);
        println!("ringcat with \"{features}\": {} crates from the registry, {} of ours", others.len(), ours.len());
        none(dependencies::not_in(features, &tree));
    }
}

// covers: library
#[test]
fn examples_and_the_program_use_the_library_alone() {
    none(dependencies::beside_the_library(&tree()));
}

// covers: tree
#[test]
fn programs_do_not_reach_through_the_library_to_its_engine() {
    none(dependencies::reach_the_engine(&tree()));
}

// covers: tree
#[test]
fn modules_of_the_engine_name_each_other_as_the_map_says() {
    none(modules::forbidden_arrows_in_engine(&tree()));
}

// covers: tree
#[test]
fn events_are_effects_of_the_model_or_listed_notices() {
    none(reports::past_the_model(&tree()));
}

// covers: tree
#[test]
fn one_reconciler_starts_the_procedures_of_the_model() {
    none(reports::started_elsewhere(&tree()));
}

#[test]
fn unsafe_code_is_where_it_may_be() {
    none(safety::misplaced(&tree()));
}

// covers: tree
#[test]
fn pure_crates_forbid_unsafe_code() {
    none(safety::not_forbidden(&tree()));
}

// covers: tree
#[test]
fn the_short_form_of_the_capabilities_is_read_in_two_minutes() {
    none(features::short_form(&tree()));
}

// covers: tree
#[test]
fn every_feature_has_a_test() {
    none(features::faults(&tree()));
}

#[test]
fn the_lists_of_tests_are_current() {
    none(evidence::outdated(&tree()));
}

#[test]
fn cited_sections_and_statements_exist() {
    none(protocol::unresolved(&tree()));
}

// covers: tree
#[test]
fn every_cited_decision_has_a_note() {
    none(decisions::unresolved(&tree()));
}

#[test]
fn names_of_tests_say_what_holds_in_80_characters() {
    none(covers::unfit_names(&tree()));
}

#[test]
fn ids_covered_by_tests_exist() {
    let tree = tree();
    println!("{}", coverage::report(&tree));
    none(covers::unresolved_covers(&tree, &features::ids(&tree)));
}

// covers: tree
#[test]
fn each_claimed_statement_about_descriptions_has_a_test() {
    none(covers::uncovered_statements(&tree()));
}

// covers: library
#[test]
fn crates_are_private_or_fit_to_be_published() {
    none(publishing::faults(&tree()));
}

// covers: tree
#[test]
fn the_list_of_random_scenarios_is_complete() {
    none(explorers::faults(&tree()));
}

#[test]
fn paths_in_the_architecture_page_exist() {
    none(paths::leading_nowhere(&tree()));
}

// covers: tree
#[test]
fn relative_links_of_pages_lead_to_files_and_headings() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    none(links::broken(&tree(), |path| root.join(path).exists()));
}

#[test]
fn one_minimum_rust_version_is_named_everywhere() {
    none(toolchain::disagreements(&tree()));
}

#[test]
fn public_types_may_grow_or_are_closed_for_a_reason() {
    none(non_exhaustive::missing(&tree()));
}

/// Checks that [`RULES`] find only the counts in `known.toml`.
fn only_what_is_known(name: &str) {
    let tree = tree();
    let rule = RULES.iter().find(|rule| rule.name == name).expect("a rule of this name");
    let known = Known::read(&tree).unwrap_or_else(|finding| panic!("{finding}"));
    let found = (rule.count)(&tree).unwrap_or_else(|finding| panic!("{finding}"));
    println!("{name}: {} of {} known", found.values().sum::<usize>(), known.total(name));
    none(known.compare(name, &found, rule.mended));
}

#[test]
fn no_figure_grew_by_more_than_a_hundredth_with_the_model_of_the_segment() {
    none(before_and_after::grown(&tree()));
}

// covers: api
#[test]
fn the_handle_of_a_subdevice_can_do_all_that_its_mailbox_can_do() {
    none(mailboxes::without_method(&tree()).unwrap_or_else(|finding| vec![finding]));
}

// covers: api
#[test]
fn public_error_types_implement_error() {
    none(errors::without_trait(&tree()).unwrap_or_else(|finding| vec![finding]));
}

// covers: api
#[test]
fn an_error_in_an_error_is_its_source() {
    none(sources::missing(&tree()).unwrap_or_else(|finding| vec![finding]));
}

#[test]
fn files_of_a_crate_name_each_other_without_circles() {
    only_what_is_known("circles");
}

#[test]
fn functions_fit_a_screen() {
    only_what_is_known("long-functions");
}

#[test]
fn files_are_read_in_one_go() {
    only_what_is_known("long-files");
}

#[test]
fn lines_fit_120_columns() {
    only_what_is_known("wide-lines");
}

#[test]
fn no_words_for_people_are_used_for_devices() {
    only_what_is_known("words");
    none(words::stale(&tree()));
}

#[test]
fn capabilities_of_the_engine_name_files_that_exist() {
    none(engine_lines::stale(&tree()));
}

#[test]
fn external_crates_match_deny_toml() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let wishes = std::fs::read_to_string(root.join(deny::PAGE)).expect("deny.toml can be read");
    let packages = deny::packages(&root).expect("cargo metadata works");
    assert!(packages.len() > 50, "{} packages", packages.len());
    none(deny::unwanted(&wishes, &packages));
}

/// After an intended change, `RINGCAT_WRITE_PUBLIC_ITEMS=1 cargo test -p tidy --test tree public` writes the list.
#[test]
fn the_list_of_public_items_is_up_to_date() {
    let tree = tree();
    let place = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(interface::LIST);
    let items = handed_on::items(&tree).unwrap_or_else(|finding| panic!("{finding}"));
    println!("{} public items of the library", items.len());
    if std::env::var_os("RINGCAT_WRITE_PUBLIC_ITEMS").is_some() {
        std::fs::write(&place, items.join("\n") + "\n").expect("the list can be written");
    }
    let list = std::fs::read_to_string(&place).expect("the list can be read");
    none(interface::changes(&items, &list));
    assert_eq!(list.lines().count(), items.len(), "an item is listed twice or no more");
}
