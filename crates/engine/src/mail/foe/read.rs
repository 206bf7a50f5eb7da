//! Reading a file.

use alloc::borrow::ToOwned;
use alloc::vec::Vec;

use ringcat_wire::mailbox::foe::{FoeErrorCode, FoeMessage};

use super::error::{FoeError, FoeFailure};
use super::{FoeOptions, FoeProgress, Transfer};
use crate::mail::Mailbox;
use crate::mail::stream::Sink;
use crate::supervisor::long_transfers::TransferKind;

/// Reads a file; returns its length in bytes. `progress` is called after each packet.
pub async fn read(
    mailbox: &Mailbox,
    file: &str,
    options: FoeOptions,
    sink: &mut impl Sink,
    progress: impl FnMut(FoeProgress),
) -> Result<u64, FoeError> {
    let result = run(mailbox, file, options, sink, progress).await;
    result.map_err(|cause| FoeError { file: file.to_owned(), cause })
}

async fn run(
    mailbox: &Mailbox,
    file: &str,
    options: FoeOptions,
    sink: &mut impl Sink,
    progress: impl FnMut(FoeProgress),
) -> Result<u64, FoeFailure> {
    let mut transfer = Transfer::begin(mailbox, options, progress).await?;
    let full = FoeMessage::max_data(transfer.conversation.mailbox_sizes().send);
    if full == 0 {
        return Err(FoeFailure::SmallMailbox);
    }
    let under_way = mailbox.begin_transfer(TransferKind::FileRead, None);
    let mut packet: u32 = 1;
    let mut bytes = 0;
    let request = FoeMessage::Read { password: options.password, name: file.as_bytes() };
    let mut data = next(&mut transfer, &request, packet).await?;
    let mut taken = sink.begin(None);
    loop {
        taken = taken.and_then(|()| sink.take(&data));
        if let Err(overflow) = taken {
            transfer.give_up(FoeErrorCode::DISK_FULL, b"file too long");
            return Err(FoeFailure::TooLong(overflow));
        }
        bytes += data.len() as u64;
        under_way.done(bytes);
        (transfer.progress)(FoeProgress::Bytes(bytes));
        let acknowledge = FoeMessage::Acknowledge { packet };
        if data.len() < full {
            // The file is complete, whether or not the last acknowledgement reaches the SubDevice.
            transfer.busy = false;
            let length = acknowledge.encode(&mut transfer.payload).ok_or(FoeFailure::SmallMailbox)?;
            transfer.conversation.send(&transfer.payload[..length], options.limits.request).await?;
            return Ok(bytes);
        }
        packet = packet.wrapping_add(1);
        data = next(&mut transfer, &acknowledge, packet).await?;
    }
}

/// Sends a message and waits for a packet as the answer.
async fn next<P: FnMut(FoeProgress)>(
    transfer: &mut Transfer<P>,
    message: &FoeMessage<'_>,
    expected: u32,
) -> Result<Vec<u8>, FoeFailure> {
    let accept = |answer: FoeMessage<'_>| match answer {
        // The previous packet again: the SubDevice repeated it before it received the acknowledgement.
        FoeMessage::Data { packet, .. } if packet == expected.wrapping_sub(1) => None,
        FoeMessage::Data { packet, data } if packet == expected => Some(Ok(data.to_vec())),
        FoeMessage::Data { packet, .. } => Some(Err(packet)),
        _ => None,
    };
    match transfer.request(message, accept).await? {
        Ok(data) => Ok(data),
        Err(got) => {
            transfer.give_up(FoeErrorCode::PACKET_NUMBER_WRONG, b"wrong packet number");
            Err(FoeFailure::Packet { expected, got })
        }
    }
}
