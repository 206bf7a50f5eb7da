//! FoE: files of a SubDevice, firmware among them.

use ringcat_engine::mail::Limits;
use ringcat_engine::mail::foe::{self, FoeOptions, FoeProgress};
use ringcat_engine::mail::stream::{Bounded, Bytes, Sink, Source};

use super::{SubDevice, SubDeviceError};
use crate::services::Services;

impl<S: Services> SubDevice<S> {
    /// Reads a file of at most [`TransferLimits::bytes`](crate::TransferLimits::bytes).
    pub fn foe_read(self, file: impl Into<String>) -> S::Outcome<Vec<u8>, SubDeviceError> {
        let options = self.file_options();
        self.foe_read_with(file, options, |_| ())
    }

    /// Reads a file with a password or other limits; `progress` is called after each packet, in the thread of the
    /// acyclic half.
    pub fn foe_read_with(
        self,
        file: impl Into<String>,
        options: FoeOptions,
        progress: impl FnMut(FoeProgress) + Send + 'static,
    ) -> S::Outcome<Vec<u8>, SubDeviceError> {
        let (file, limit) = (file.into(), self.limits.bytes);
        self.ask_mailbox(move |mailbox| async move {
            let mut sink = Bounded::new(limit);
            foe::read(&mailbox, &file, options, &mut sink, progress).await?;
            Ok::<_, foe::FoeError>(sink.into_bytes())
        })
    }

    /// Reads a file of any size into `sink`, packet by packet, and returns the sink. It is called in the thread of the
    /// acyclic half.
    pub fn foe_read_into<K: Sink + Send + 'static>(
        self,
        file: impl Into<String>,
        mut sink: K,
        options: FoeOptions,
        progress: impl FnMut(FoeProgress) + Send + 'static,
    ) -> S::Outcome<K, SubDeviceError> {
        let file = file.into();
        self.ask_mailbox(move |mailbox| async move {
            foe::read(&mailbox, &file, options, &mut sink, progress).await?;
            Ok::<_, foe::FoeError>(sink)
        })
    }

    /// Writes a file of any size from `source`, packet by packet; the result is its size in bytes. It is called in the
    /// thread of the acyclic half.
    pub fn foe_write_from(
        self,
        file: impl Into<String>,
        mut source: impl Source + Send + 'static,
        options: FoeOptions,
        progress: impl FnMut(FoeProgress) + Send + 'static,
    ) -> S::Outcome<u64, SubDeviceError> {
        let file = file.into();
        self.ask_mailbox(
            move |mailbox| async move { foe::write(&mailbox, &file, options, &mut source, progress).await },
        )
    }

    /// Writes a file; the result is its size in bytes.
    pub fn foe_write(self, file: impl Into<String>, data: Vec<u8>) -> S::Outcome<u64, SubDeviceError> {
        let options = self.file_options();
        self.foe_write_with(file, data, options, |_| ())
    }

    /// Writes a file with a password or other limits; `progress` is called after each packet, in the thread of the
    /// acyclic half.
    pub fn foe_write_with(
        self,
        file: impl Into<String>,
        data: Vec<u8>,
        options: FoeOptions,
        progress: impl FnMut(FoeProgress) + Send + 'static,
    ) -> S::Outcome<u64, SubDeviceError> {
        let file = file.into();
        self.ask_mailbox(move |mailbox| async move {
            foe::write(&mailbox, &file, options, &mut Bytes::new(&data), progress).await
        })
    }

    /// A packet may take longer than an object: flash memory is erased meanwhile.
    fn file_options(&self) -> FoeOptions {
        let options = FoeOptions::default();
        let Limits { request, answer, .. } = options.limits;
        let limits = Limits::new(self.limits.request.max(request), self.limits.answer.max(answer));
        options.with_limits(limits)
    }
}
