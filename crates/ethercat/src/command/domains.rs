//! `domains`: domains of the application with their process data.

use ringcat_control::message::{Answer, Query};
use ringcat_control::tool::{DomainLine, ToolAnswer, ToolQuery};

use crate::append::append;
use crate::failure::{Failure, unexpected};
use crate::hex;
use crate::json;
use crate::json::domains::{Domains, Selected, area_bytes};
use crate::session::Session;
use crate::shape::{Command, Output};

/// The command.
pub const COMMAND: Command = Command {
    name: "domains",
    summary: "Show configured domains.",
    forms: &[""],
    help: "One line for each domain of the active application: logical address,
bytes, working counter and its expected value. With two link devices the
working counters of both follow in parentheses.

With --verbose the process data of each slave configuration.
",
    options: "  --domain -d <index>  Domains; all by default.\n",
    output: Output::Data,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let masters = session.masters()?;
    let (is_several, is_verbose) = (masters.len() > 1, session.arguments.verbose);
    for master in masters {
        let domains = selected(session, master.master);
        let domains = session.if_driven(domains)?.unwrap_or_default();
        if session.arguments.json {
            json::print(session, &Domains::new(master.master, &domains))?;
            continue;
        }
        if is_several && !domains.is_empty() {
            writeln!(session, "Master{}", master.master)?;
        }
        let indent = if is_several { "  " } else { "" };
        for (number, domain, image) in domains {
            session.write_text(&text(indent, number, &domain))?;
            if is_verbose {
                session.write_text(&areas(indent, &domain, &image))?;
            }
        }
    }
    Ok(())
}

/// The selected domains of a master: number, domain, image.
pub(super) fn selected(session: &mut Session<'_>, master: u32) -> Result<Vec<Selected>, Failure> {
    let list = session.list(session.arguments.domain.as_deref(), "domain")?;
    let (answer, images) = session.ask(master, Query::Tool(ToolQuery::Domains), Vec::new())?;
    let Answer::Tool(ToolAnswer::Domains(domains)) = answer else { return Err(unexpected()) };
    let mut rest = &images[..];
    let mut selected = Vec::new();
    for (number, domain) in (0..).zip(domains) {
        let length = (domain.bytes as usize).min(rest.len());
        let (image, behind) = rest.split_at(length);
        rest = behind;
        if list.has(number) {
            selected.push((number, domain, image.to_vec()));
        }
    }
    Ok(selected)
}

fn text(indent: &str, number: u32, domain: &DomainLine) -> String {
    let by_link = domain.by_link.map(|[main, backup]| format!(" ({main}+{backup})")).unwrap_or_default();
    let DomainLine { logical, bytes, wkc, expected, .. } = domain;
    format!(
        "{indent}Domain{number}: LogBaseAddr 0x{logical:08x}, Size {bytes:>3}, \
         WorkingCounter {wkc}/{expected}{by_link}\n"
    )
}

fn areas(indent: &str, domain: &DomainLine, image: &[u8]) -> String {
    let mut text = String::new();
    for area in &domain.areas {
        let (alias, position) = area.subdevice;
        let direction = if area.is_output { "Output" } else { " Input" };
        append!(text, "{indent}  SlaveConfig {alias}:{position}, SM{} ({direction}), ", area.sync_manager);
        append!(text, "LogAddr 0x{:08x}, Size {}\n", area.logical, area.length);
        text += &hex::lines(&format!("{indent}    "), area_bytes(area.offset, area.length, image));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringcat_control::tool::AreaLine;

    // covers: daemon
    #[test]
    fn domains_have_working_counters_by_link_and_process_data() {
        let area =
            AreaLine { subdevice: (1000, 0), sync_manager: 3, logical: 1, offset: 1, length: 2, ..AreaLine::default() };
        let domain = DomainLine { bytes: 3, wkc: 2, expected: 3, areas: vec![area], ..DomainLine::default() };
        let wanted = "Domain0: LogBaseAddr 0x00000000, Size   3, WorkingCounter 2/3\n";
        assert_eq!(text("", 0, &domain), wanted);
        let ring = DomainLine { by_link: Some([2, 1]), ..domain.clone() };
        assert_eq!(text("  ", 0, &ring), format!("  {} (2+1)\n", wanted.trim_end()));
        let wanted = "  SlaveConfig 1000:0, SM3 ( Input), LogAddr 0x00000001, Size 2\n    02 03 \n";
        assert_eq!(areas("", &domain, &[1, 2, 3]), wanted);
    }
}
