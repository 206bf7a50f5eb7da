//! Orders about the mail of a simulated device: emergencies, and what goes wrong on purpose.
//!
//! Input: the words behind the device. Output: the fault, or an error with what is allowed.

use core::time::Duration;

use ringcat::sim::application::mailbox::faults::MailFault;
use ringcat::sim::device::Device;
use ringcat::wire::mailbox::coe::Emergency;
use ringcat::wire::mailbox::sdo::AbortCode;

/// What `help` says about them.
pub const HELP: &str = "\
CODE is hexadecimal, N counts messages of device A.
emergency A CODE         device A sends an emergency with this error code
mail A lose N            the next N answers are lost
mail A forget N          the next N requests are lost
mail A twice N           the next N answers come twice with one counter
mail A late N MS         the next N answers come MS milliseconds later
mail A count N C         the next N answers have the counter C
mail A emergency N CODE  an emergency comes right before the next N answers
mail A refuse N          the next N requests get an error reply
mail A abort N CODE      the next N SDO requests are aborted with this code
mail A busy N            the next N FoE messages are answered with BUSY
mail A full MS           no message is taken from the mailbox for MS ms
mail A heal              end of all this";

/// Longest time that an order takes.
const MAX_MS: u32 = 3_600_000;
/// Error register of an emergency: generic error.
const GENERIC: u8 = 0x01;
/// Detail of an error reply: service in work.
const IN_WORK: u16 = ringcat::wire::mailbox::ErrorReply::SERVICE_IN_WORK;

/// The fault that the words behind `mail A` mean.
pub fn fault(words: &[&str]) -> Result<MailFault, String> {
    let count = |text: &str| text.parse().map_err(|_| format!("expected a number of messages, got \"{text}\""));
    Ok(match words {
        ["lose", n] => MailFault::LoseAnswers { count: count(n)? },
        ["forget", n] => MailFault::LoseRequests { count: count(n)? },
        ["twice", n] => MailFault::RepeatAnswers { count: count(n)? },
        ["late", n, ms] => MailFault::DelayAnswers { count: count(n)?, by: time(ms)? },
        ["count", n, counter] => {
            let counter = counter.parse().ok().filter(|counter| *counter <= 7);
            let counter = counter.ok_or_else(|| "expected a counter from 0 to 7".to_owned())?;
            MailFault::WrongCounter { count: count(n)?, counter }
        }
        ["emergency", n, code] => MailFault::EmergencyBefore { count: count(n)?, code: error_code(code)? },
        ["refuse", n] => MailFault::Refuse { count: count(n)?, detail: IN_WORK },
        ["abort", n, code] => MailFault::AbortSdo { count: count(n)?, code: AbortCode(hexadecimal(code)?) },
        ["busy", n] => MailFault::BusyFoe { count: count(n)? },
        ["full", ms] => MailFault::Full { during: time(ms)? },
        ["heal"] => MailFault::Heal,
        _ => return Err(format!("\"mail A {}\" is no order; `help` lists them", words.join(" "))),
    })
}

/// Lets a device send an emergency.
pub fn emergency(device: &mut Device, code: &str) -> Result<(), String> {
    let error_code =
        u16::try_from(hexadecimal(code)?).map_err(|_| format!("expected a code of 16 bits, got {code}"))?;
    let emergency = Emergency { error_code, error_register: GENERIC, data: [0; 5] };
    let has_coe = device.description.has_coe();
    if has_coe && device.application.emergency(&emergency) {
        return Ok(());
    }
    Err("it has no CoE, its mailbox is not in use, or too much mail waits in it".to_owned())
}

fn time(text: &str) -> Result<Duration, String> {
    let ms: Option<u32> = text.parse().ok().filter(|ms| *ms <= MAX_MS);
    let ms = ms.ok_or_else(|| format!("expected 0 to {MAX_MS} milliseconds, got \"{text}\""))?;
    Ok(Duration::from_millis(ms.into()))
}

fn error_code(text: &str) -> Result<u16, String> {
    u16::try_from(hexadecimal(text)?).map_err(|_| format!("expected a code of 16 bits, got {text}"))
}

fn hexadecimal(text: &str) -> Result<u32, String> {
    let digits = text.strip_prefix("0x").unwrap_or(text);
    u32::from_str_radix(digits, 16).map_err(|_| format!("expected a code in hexadecimal, got \"{text}\""))
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: sim-interfaces
    #[test]
    fn each_order_about_mail_is_understood() {
        let ms = Duration::from_millis;
        for (order, expected) in [
            ("lose 4294967295", MailFault::LoseAnswers { count: u32::MAX }),
            ("forget 1", MailFault::LoseRequests { count: 1 }),
            ("twice 2", MailFault::RepeatAnswers { count: 2 }),
            ("late 1 50", MailFault::DelayAnswers { count: 1, by: ms(50) }),
            ("count 1 7", MailFault::WrongCounter { count: 1, counter: 7 }),
            ("emergency 1 8130", MailFault::EmergencyBefore { count: 1, code: 0x8130 }),
            ("refuse 3", MailFault::Refuse { count: 3, detail: 9 }),
            ("abort 1 0x08000000", MailFault::AbortSdo { count: 1, code: AbortCode::GENERAL }),
            ("busy 5", MailFault::BusyFoe { count: 5 }),
            ("full 100", MailFault::Full { during: ms(100) }),
            ("heal", MailFault::Heal),
        ] {
            let words: Vec<&str> = order.split(' ').collect();
            assert_eq!(fault(&words), Ok(expected), "{order}");
            assert!(HELP.contains(&format!("mail A {}", words[0])), "{order}");
        }
    }

    // covers: sim-interfaces
    #[test]
    fn an_order_about_mail_that_makes_no_sense_is_answered_with_what_would() {
        for (order, part) in [
            ("eat 1", "\"mail A eat 1\" is no order"),
            ("lose many", "expected a number of messages, got \"many\""),
            ("count 1 8", "expected a counter from 0 to 7"),
            ("late 1 -5", "expected 0 to 3600000 milliseconds, got \"-5\""),
            ("abort 1 xyz", "expected a code in hexadecimal, got \"xyz\""),
        ] {
            let words: Vec<&str> = order.split(' ').collect();
            let error = fault(&words).unwrap_err();
            assert!(error.contains(part), "{order}: {error}");
        }
    }
}
