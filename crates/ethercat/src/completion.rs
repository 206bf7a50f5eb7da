//! Completion scripts for shells, from the same source as the help.

use std::fmt::Write;

use crate::commands::ALL;
use crate::options_help::{OptionHelp, common, of};
use crate::shape::Command;
use values::{Values, argument, most_arguments, of_option};

mod values;

/// Words with which options of a command are written.
fn words(options: &[OptionHelp]) -> String {
    let words = |option: &OptionHelp| match option.letter {
        "" => format!("--{}", option.name),
        letter => format!("--{} -{letter}", option.name),
    };
    options.iter().map(words).collect::<Vec<_>>().join(" ")
}

fn all_options(command: &Command) -> Vec<OptionHelp> {
    of(command).into_iter().chain(common()).collect()
}

/// Each option of all commands that takes a value, once.
fn valued() -> Vec<OptionHelp> {
    let mut all: Vec<OptionHelp> = Vec::new();
    for option in common().into_iter().chain(ALL.into_iter().flat_map(of)) {
        if !option.value.is_empty() && all.iter().all(|known| known.name != option.name) {
            all.push(option);
        }
    }
    all
}

/// Sets what bash offers.
fn bash_values(values: &Values) -> String {
    match values {
        Values::Words(words) => format!("words='{}'", words.join(" ")),
        Values::Interfaces => "words=$(cd /sys/class/net && compgen -d) || true".to_owned(),
        Values::Files => "files=yes".to_owned(),
        Values::Unknown => ":".to_owned(),
    }
}

/// Cases of options with a value, and of commands with the number of arguments before the word.
fn bash_cases() -> (String, String) {
    let (mut options, mut arguments) = (String::new(), String::new());
    for option in valued() {
        let pattern = words(std::slice::from_ref(&option)).replace(' ', "|");
        // Writing to a string cannot fail, here and below.
        let _ = writeln!(options, "      {pattern}) {} ;;", bash_values(&of_option(&option)));
    }
    for command in ALL {
        for at in 0..most_arguments(command) {
            let values = argument(command, at);
            if values != Values::Unknown {
                let _ = writeln!(arguments, "      {}:{at}) {} ;;", command.name, bash_values(&values));
            }
        }
    }
    (options, arguments)
}

/// For bash: `/usr/share/bash-completion/completions/ethercat`.
pub fn bash() -> String {
    let names: Vec<&str> = ALL.into_iter().map(|command| command.name).collect();
    let valued: Vec<String> =
        valued().iter().map(|option| words(std::slice::from_ref(option)).replace(' ', "|")).collect();
    let mut own = String::new();
    for command in ALL {
        let _ = writeln!(own, "      {}) options='{}' ;;", command.name, words(&all_options(command)));
    }
    let (options, arguments) = bash_cases();
    format!(
        "# Completion of ethercat for bash.
_ethercat() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} command= option= options= words= files= count=0 at
  for ((at = 1; at < COMP_CWORD; at++)); do
    case ${{COMP_WORDS[at]}} in
      {valued})
        option=${{COMP_WORDS[at]}}
        if [[ ${{COMP_WORDS[at + 1]}} == '=' && at+1 -lt COMP_CWORD ]]; then ((++at)); fi
        ((++at)) ;;
      -*) ;;
      *) if [[ $command ]]; then ((++count)); else command=${{COMP_WORDS[at]}}; fi ;;
    esac
  done
  if ((at > COMP_CWORD)); then
    if [[ $word == '=' ]]; then word=; fi
    case $option in
{options}    esac
  elif [[ ! $command ]]; then
    words='{names}' options='{common}'
  else
    case $command in
{own}    esac
    case $command:$count in
{arguments}    esac
  fi
  if [[ $word == -* || ! $words$files ]]; then words+=\" $options\"; fi
  COMPREPLY=($(compgen -W \"$words\" -- \"$word\" || true))
  if [[ $files ]]; then
    local file
    compopt -o filenames 2> /dev/null || true
    while IFS= read -r file; do COMPREPLY+=(\"$file\"); done < <(compgen -f -- \"$word\")
  fi
}}
complete -F _ethercat ethercat
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

/// What completes a value in zsh.
fn zsh_values(values: &Values) -> String {
    match values {
        Values::Words(words) => format!("({})", words.join(" ")),
        Values::Interfaces => "_net_interfaces".to_owned(),
        Values::Files => "_files".to_owned(),
        Values::Unknown => " ".to_owned(),
    }
}

fn zsh_option(option: &OptionHelp) -> String {
    let OptionHelp { name, letter, value, text } = option;
    let text = quoted(text);
    let value = match value.is_empty() {
        true => String::new(),
        false => format!(":{value}:{}", zsh_values(&of_option(option))),
    };
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
        for at in 0..most_arguments(command) {
            let _ = write!(text, " \\\n          '{}::argument:{}'", at + 1, zsh_values(&argument(command, at)));
        }
        text += " ;;\n";
    }
    text + "      esac ;;\n  esac\n}\n_ethercat \"$@\"\n"
}

/// The options of `complete` in fish for a value.
fn fish_values(values: &Values) -> String {
    match values {
        Values::Words(words) => format!(" -x -a '{}'", words.join(" ")),
        Values::Interfaces => " -x -a '(__fish_print_interfaces)'".to_owned(),
        Values::Files => " -r -F".to_owned(),
        Values::Unknown => " -x".to_owned(),
    }
}

fn fish_option(option: &OptionHelp, condition: &str) -> String {
    let OptionHelp { name, letter, value, text } = option;
    let value = if value.is_empty() { String::new() } else { fish_values(&of_option(option)) };
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
        let all: Vec<Values> = (0..most_arguments(command)).map(|at| argument(command, at)).collect();
        if !all.contains(&Values::Files) {
            let _ = writeln!(text, "complete -c ethercat{condition} -f");
        }
        // fish offers them for each argument.
        if let Some(Values::Words(words)) = all.first() {
            let _ = writeln!(text, "complete -c ethercat{condition} -a '{}'", words.join(" "));
        }
    }
    text
}
