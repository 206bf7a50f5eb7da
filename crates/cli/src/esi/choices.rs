//! Options that choose the contents of a device: operation mode, modules, PDOs, entries, start-up values.

use std::time::Duration;

use clap::Args;
use ringcat::config::esi::{Choices, EntryChoice, MappingChoice, Parameter, PdoChoice, SamplesChoice, Transition};

use crate::numbers::number_of_32_bits as number;
use crate::times::cycle;

/// What is chosen for a device.
#[derive(Args, Clone, Debug)]
pub struct ChoiceArguments {
    /// Mode of the clock: name, description or number ("#3"); the first by default
    #[arg(long, value_name = "MODE", help_heading = "Choices")]
    mode: Option<String>,
    /// Module of the next slot by type or ident; - for an empty slot
    #[arg(long, value_name = "MODULE", help_heading = "Choices", allow_hyphen_values = true)]
    module: Vec<String>,
    /// A further PDO, in a SyncManager: 0x1A01 or 0x1A01:3
    #[arg(long, value_name = "PDO[:SM]", value_parser = pdo, help_heading = "Choices")]
    with: Vec<PdoChoice>,
    /// A PDO that is not assigned although it is by default
    #[arg(long, value_name = "PDO", value_parser = index, help_heading = "Choices")]
    without: Vec<u16>,
    /// Entries of a PDO: 0x1600=0x6040:0,0x607A:0, with bits 0x6040:0:16
    #[arg(long, value_name = "PDO=ENTRIES", value_parser = mapping, help_heading = "Choices")]
    map: Vec<MappingChoice>,
    /// Oversampling factor of a PDO: 0x1A00=10
    #[arg(long, value_name = "PDO=FACTOR", value_parser = samples, help_heading = "Choices")]
    samples: Vec<SamplesChoice>,
    /// A start-up value in hexadecimal bytes: 0x8000:3=c800, at SO @SO behind it
    #[arg(long = "set", value_name = "OBJECT=BYTES", value_parser = parameter, help_heading = "Choices")]
    parameters: Vec<Parameter>,
    /// Cycle time, with its unit: 250us, 1ms; with --append that of the file
    #[arg(long, value_name = "TIME", default_value = "1ms", value_parser = cycle, help_heading = "Choices")]
    pub cycle: Duration,
    /// Language of names
    #[arg(long, value_name = "LCID", default_value_t = crate::descriptions::ENGLISH, help_heading = "Choices")]
    pub language: u32,
}

impl ChoiceArguments {
    /// As the library takes them.
    pub fn choices(&self) -> Choices {
        let mut choices = Choices::default();
        choices.mode.clone_from(&self.mode);
        choices.modules = self.module.iter().cloned().map(Some).collect();
        choices.with.clone_from(&self.with);
        choices.without.clone_from(&self.without);
        choices.mappings.clone_from(&self.map);
        choices.samples.clone_from(&self.samples);
        choices.parameters.clone_from(&self.parameters);
        choices.language = self.language;
        choices
    }
}

fn index(text: &str) -> Result<u16, String> {
    number(text)
        .and_then(|number| u16::try_from(number).map_err(|_| format!("expected an index such as 0x1A00, got {text}")))
}

fn small(text: &str, what: &str) -> Result<u8, String> {
    number(text).ok().and_then(|number| u8::try_from(number).ok()).ok_or_else(|| format!("expected {what}, got {text}"))
}

fn pair<'a>(text: &'a str, example: &str) -> Result<(&'a str, &'a str), String> {
    text.split_once('=').ok_or_else(|| format!("expected a text such as {example}, got {text}"))
}

fn pdo(text: &str) -> Result<PdoChoice, String> {
    match text.split_once(':') {
        None => Ok(PdoChoice::new(index(text)?, None)),
        Some((pdo, sm)) => Ok(PdoChoice::new(index(pdo)?, Some(small(sm, "the number of a SyncManager")?))),
    }
}

fn entry(text: &str) -> Result<EntryChoice, String> {
    let mut parts = text.split(':');
    let object = index(parts.next().unwrap_or_default())?;
    let sub_index = parts.next().map_or(Ok(0), |sub| small(sub, "a subindex"))?;
    let bits = parts.next().map(|bits| small(bits, "1 to 255 bits")).transpose()?.filter(|bits| *bits > 0);
    match parts.next() {
        Some(_) => Err(format!("expected INDEX:SUBINDEX:BITS, got {text}")),
        None => Ok(EntryChoice::new(object, sub_index, bits)),
    }
}

fn mapping(text: &str) -> Result<MappingChoice, String> {
    let (pdo, entries) = pair(text, "0x1600=0x6040:0,0x607A:0")?;
    let entries = entries.split(',').map(str::trim).filter(|entry| !entry.is_empty());
    Ok(MappingChoice::new(index(pdo)?, entries.map(entry).collect::<Result<_, _>>()?))
}

fn samples(text: &str) -> Result<SamplesChoice, String> {
    let (pdo, factor) = pair(text, "0x1A00=10")?;
    let factor = factor.parse().map_err(|_| format!("expected an oversampling factor, got {factor}"))?;
    Ok(SamplesChoice::new(index(pdo)?, factor))
}

fn parameter(text: &str) -> Result<Parameter, String> {
    let (object, rest) = pair(text, "0x8000:3=c800")?;
    let (index_text, sub) = object.split_once(':').unwrap_or((object, "0"));
    let (digits, at) = rest.split_once('@').unwrap_or((rest, "PS"));
    let transition = match at {
        "IP" => Transition::Ip,
        "PS" => Transition::Ps,
        "SO" => Transition::So,
        "SP" => Transition::Sp,
        "OS" => Transition::Os,
        _ => return Err(format!("expected a transition IP, PS, SO, SP or OS, got {at}")),
    };
    let digits: Vec<char> = digits.chars().filter(|c| !c.is_whitespace()).collect();
    let byte = |pair: &[char]| {
        let text: String = pair.iter().collect();
        u8::from_str_radix(&text, 16).ok().filter(|_| pair.len() == 2 && pair[0] != '+')
    };
    let data: Option<Vec<u8>> = digits.chunks(2).map(byte).collect();
    let data = data.filter(|data| !data.is_empty());
    let data = data.ok_or_else(|| format!("expected pairs of hexadecimal digits, got {rest}"))?;
    Ok(Parameter::new(index(index_text)?, small(sub, "a subindex")?, data).at(transition))
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: esi-declare
    #[test]
    fn choices_are_read_from_the_command_line_or_refused_with_an_example() {
        assert_eq!(pdo("0x1A01:3"), Ok(PdoChoice::new(0x1A01, Some(3))));
        assert_eq!(pdo("6657"), Ok(PdoChoice::new(0x1A01, None)));
        let entries = vec![EntryChoice::new(0x6040, 0, None), EntryChoice::new(0, 0, Some(8))];
        assert_eq!(mapping("0x1600=0x6040:0, 0:0:8"), Ok(MappingChoice::new(0x1600, entries)));
        assert_eq!(samples("0x1A00=10"), Ok(SamplesChoice::new(0x1A00, 10)));
        assert_eq!(parameter("0x8000:3=c8 00@SO"), Ok(Parameter::new(0x8000, 3, [0xC8, 0]).at(Transition::So)));
        for wrong in [
            "0x8000:3",
            "0x8000:3=c",
            "0x8000:300=c8",
            "0x8000:3=c800@XY",
            "0x8000:3=c800@OP",
            "0x80000=00",
            "0x8000:3=",
        ] {
            assert!(parameter(wrong).is_err_and(|error| error.contains("expected")), "{wrong}");
        }
        assert!(pdo("0x1A01:x").is_err() && mapping("0x1600").is_err() && entry("0x6040:0:16:1").is_err());
    }
}
