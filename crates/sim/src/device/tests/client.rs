//! The MainDevice side of the mailbox: sends requests, waits for responses, transfers objects.

use core::time::Duration;

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::sdo::{AbortCode, SdoRequest, SdoResponse};
use ringcat_wire::mailbox::{Header, Protocol, next_counter};
use ringcat_wire::register::{SyncManager, map};

use super::bench::Bench;
use crate::catalogue;
use crate::description::DeviceDescription;

/// Longer than the response time of a device.
pub const ANSWER: Duration = Duration::from_millis(1);

/// The MainDevice side of the mailbox.
pub struct Client {
    pub bench: Bench,
    pub counter: u8,
}

impl Client {
    pub fn new(name: &str, state: AlState) -> Client {
        Client::of(catalogue::by_name(name).unwrap(), state)
    }

    /// A client for a modified device.
    pub fn of(description: DeviceDescription, state: AlState) -> Client {
        Client::on(Bench::up_to(description, state))
    }

    /// A client for a device on its bench.
    pub fn on(bench: Bench) -> Client {
        Client { bench, counter: 0 }
    }

    pub fn post(&mut self, protocol: Protocol, payload: &[u8]) {
        self.counter = next_counter(self.counter);
        let header = Header::new(protocol, self.counter, payload.len() as u16);
        assert!(self.bench.send_mail(header, payload), "the mailbox is full");
    }

    pub fn post_sdo(&mut self, request: &SdoRequest<'_>) {
        let mut payload = [0; 1018];
        let length = request.encode(&mut payload).unwrap();
        self.post(Protocol::Coe, &payload[..length]);
    }

    pub fn answer(&mut self) -> (Header, Vec<u8>) {
        self.bench.pass(ANSWER);
        self.bench.fetch_mail().expect("an answer")
    }

    pub fn sdo(&mut self, request: &SdoRequest<'_>) -> Result<Vec<u8>, AbortCode> {
        self.post_sdo(request);
        let (header, payload) = self.answer();
        assert_eq!(header.protocol, Protocol::Coe);
        match SdoResponse::decode(&payload).unwrap() {
            SdoResponse::DownloadDone { .. } => Ok(Vec::new()),
            SdoResponse::UploadExpedited { data, .. } => Ok(data.to_vec()),
            SdoResponse::UploadNormal { data, total, .. } => {
                assert_eq!(total as usize, data.len());
                Ok(data.to_vec())
            }
            SdoResponse::Abort { code, .. } => Err(code),
            other => panic!("{other:?}"),
        }
    }

    pub fn upload(&mut self, index: u16, sub_index: u8) -> Result<Vec<u8>, AbortCode> {
        self.sdo(&SdoRequest::Upload { index, sub_index, complete_access: false })
    }

    pub fn download(&mut self, index: u16, sub_index: u8, data: &[u8]) -> Result<Vec<u8>, AbortCode> {
        let complete_access = false;
        if data.len() <= 4 {
            return self.sdo(&SdoRequest::DownloadExpedited { index, sub_index, complete_access, data });
        }
        let total = data.len() as u32;
        self.sdo(&SdoRequest::DownloadNormal { index, sub_index, complete_access, total, data })
    }

    pub fn toggle_repeat(&mut self) -> u8 {
        let address = map::sync_manager(1).offset(SyncManager::ACTIVATE);
        let toggled = self.bench.read(address, 1)[0] ^ 0x02;
        self.bench.write(address, &[toggled]);
        toggled & 0x02
    }

    pub fn repeat_acknowledge(&mut self) -> u8 {
        self.bench.read(map::sync_manager(1).offset(SyncManager::PDI_CONTROL), 1)[0] & 0x02
    }
}
