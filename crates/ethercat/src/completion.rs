//! Completion scripts for shells, from the same source as the help.

use std::fmt::Write;

use crate::arguments::{OPTIONS, OWN};
use crate::commands::ALL;
use crate::options_help::{OptionHelp, common, of};
use crate::shape::Command;

/// Words with which options of a command are written.
fn words(options: &[OptionHelp]) -> String {
    let words = |option: &OptionHelp| match option.letter {
        "" => format!("--{}", option.name),
        letter => format!("--{} -{letter}", option.name),
    };
    options.iter().map(words).collect::<Vec<_>>().join(" ")
}

/// Words that a command may have as they are: those in its forms that are no place-holders.
fn literals(command: &Command) -> impl Iterator<Item = &'static str> {
    let words = command.forms.iter().flat_map(|form| form.split_whitespace());
    words.filter(|word| word.chars().all(|it| it.is_ascii_lowercase()))
}

fn all_options(command: &Command) -> Vec<OptionHelp> {
    of(command).into_iter().chain(common()).collect()
}

/// For bash: `/usr/share/bash-completion/completions/ethercat`.
pub fn bash() -> String {
    let names: Vec<&str> = ALL.into_iter().map(|command| command.name).collect();
    let valued: Vec<String> = OPTIONS
        .iter()
        .filter(|(.., has_value)| *has_value)
        .map(|(letter, name, _)| format!("-{letter}|--{name}"))
        .chain(OWN.iter().filter(|(_, has_value)| *has_value).map(|(name, _)| format!("--{name}")))
        .collect();
    let mut cases = String::new();
    for command in ALL {
        let literals: String = literals(command).map(|word| format!("{word} ")).collect();
        // Writing to a string cannot fail, here and below.
        let _ = writeln!(cases, "    {}) words=\"{literals}{}\" ;;", command.name, words(&all_options(command)));
    }
    format!(
        "# Completion of ethercat for bash.
_ethercat() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} command= words= at
  for ((at = 1; at < COMP_CWORD; at++)); do
    case ${{COMP_WORDS[at]}} in
      {valued}) ((at++)) ;;
      -*) ;;
      *) command=${{COMP_WORDS[at]}}; break ;;
    esac
  done
  case $command in
    '') words=\"{names} {common}\" ;;
{cases}  esac
  COMPREPLY=($(compgen -W \"$words\" -- \"$word\"))
}}
complete -o default -F _ethercat ethercat
",
        valued = valued.join("|"),
        names = names.join(" "),
        common = words(&common()),
    )
}

/// A text between single quotes, for all three shells.
fn quoted(text: &str) -> String {
    text.replace('\'', "").replace(['[', ']', ':'], " ").replace('\\', " ")
}

fn zsh_option(option: &OptionHelp) -> String {
    let OptionHelp { name, letter, value, text } = option;
    let text = quoted(text);
    let value = if value.is_empty() { String::new() } else { format!(":{value}:_default") };
    match *letter {
        "" => format!("'--{name}[{text}]{value}'"),
        letter => format!("'(-{letter} --{name})'{{-{letter},--{name}}}'[{text}]{value}'"),
    }
}

/// For zsh: `_ethercat` in a directory of `fpath`.
pub fn zsh() -> String {
    let mut text =
        "#compdef ethercat\n# Completion of ethercat for zsh.\n_ethercat() {\n  local -a commands\n".to_owned();
    text += "  commands=(\n";
    for command in ALL {
        let _ = writeln!(text, "    '{}:{}'", command.name, quoted(command.summary));
    }
    text += "  )\n  local context state state_descr line\n  typeset -A opt_args\n  _arguments -C \\\n";
    for option in common() {
        let _ = writeln!(text, "    {} \\", zsh_option(&option));
    }
    text += "    '1:command:->command' '*::argument:->argument'\n";
    text += "  case $state in\n    command) _describe command commands ;;\n    argument)\n      case $words[1] in\n";
    for command in ALL {
        let _ = write!(text, "        {}) _arguments", command.name);
        for option in all_options(command) {
            let _ = write!(text, " \\\n          {}", zsh_option(&option));
        }
        let literals: Vec<&str> = literals(command).collect();
        let rest = if literals.is_empty() { "_default".to_owned() } else { format!("({})", literals.join(" ")) };
        let _ = writeln!(text, " \\\n          '*:argument:{rest}' ;;");
    }
    text + "      esac ;;\n  esac\n}\n_ethercat \"$@\"\n"
}

fn fish_option(option: &OptionHelp, condition: &str) -> String {
    let OptionHelp { name, letter, value, text } = option;
    let value = if value.is_empty() { "" } else { " -r" };
    let letter = if letter.is_empty() { String::new() } else { format!(" -s {letter}") };
    format!("complete -c ethercat{condition} -l {name}{letter}{value} -d '{}'\n", quoted(text))
}

/// For fish: `/usr/share/fish/vendor_completions.d/ethercat.fish`.
pub fn fish() -> String {
    let mut text = "# Completion of ethercat for fish.\n".to_owned();
    common().iter().for_each(|option| text += &fish_option(option, ""));
    for command in ALL {
        let (name, summary) = (command.name, quoted(command.summary));
        let _ = writeln!(text, "complete -c ethercat -f -n __fish_use_subcommand -a {name} -d '{summary}'");
        let condition = format!(" -n '__fish_seen_subcommand_from {name}'");
        of(command).iter().for_each(|option| text += &fish_option(option, &condition));
        for word in literals(command) {
            let _ = writeln!(text, "complete -c ethercat{condition} -a {word}");
        }
    }
    text
}
