//! Writing a file.

use alloc::borrow::ToOwned;
use alloc::vec;

use ringcat_wire::mailbox::foe::FoeMessage;
use ringcat_wire::memory_write::WriteKind;

use super::error::{FoeError, FoeFailure};
use super::{FoeOptions, FoeProgress, Transfer};
use crate::mail::Mailbox;
use crate::mail::stream::Source;
use crate::supervisor::long_transfers::TransferKind;

/// Writes a file; returns its length in bytes. `progress` is called after each packet.
pub async fn write(
    mailbox: &Mailbox,
    file: &str,
    options: FoeOptions,
    source: &mut impl Source,
    progress: impl FnMut(FoeProgress),
) -> Result<u64, FoeError> {
    let result = run(mailbox, file, options, source, progress).await;
    result.map_err(|cause| FoeError { file: file.to_owned(), cause })
}

async fn run(
    mailbox: &Mailbox,
    file: &str,
    options: FoeOptions,
    source: &mut impl Source,
    progress: impl FnMut(FoeProgress),
) -> Result<u64, FoeFailure> {
    let mut transfer = Transfer::begin(mailbox, options, progress).await?;
    let _write = mailbox.begin_memory_write(WriteKind::File);
    let full = FoeMessage::max_data(transfer.conversation.mailbox_sizes().receive);
    if full == 0 {
        return Err(FoeFailure::SmallMailbox);
    }
    let request = FoeMessage::Write { password: options.password, name: file.as_bytes() };
    transfer.request(&request, acknowledged(0)).await?;
    let under_way = mailbox.begin_transfer(TransferKind::FileWrite, source.total());
    let mut data = vec![0; full];
    let (mut packet, mut bytes) = (0u32, 0);
    loop {
        let count = source.fill(&mut data).min(full);
        packet = packet.wrapping_add(1);
        transfer.request(&FoeMessage::Data { packet, data: &data[..count] }, acknowledged(packet)).await?;
        bytes += count as u64;
        under_way.done(bytes);
        (transfer.progress)(FoeProgress::Bytes(bytes));
        // A packet with less data than fits ends the file; it is empty if the length is a multiple of a full packet.
        if count < full {
            transfer.busy = false;
            return Ok(bytes);
        }
    }
}

/// Recognises the acknowledgement of a packet; others belong to packets that were repeated while the SubDevice was
/// busy.
fn acknowledged(expected: u32) -> impl FnMut(FoeMessage<'_>) -> Option<()> {
    move |answer| match answer {
        FoeMessage::Acknowledge { packet } => (packet == expected).then_some(()),
        _ => None,
    }
}
