//! Reads and writes registers of one SubDevice, which must answer, or of all SubDevices.

use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::address::{Position, RegisterAddress, StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;

use super::Bus;
use crate::supervisor::reply::{BusError, Reply};
use crate::supervisor::transfer::Request;

impl Bus {
    /// Reads registers of all SubDevices, ORed.
    pub async fn brd(&self, register: RegisterAddress, length: usize) -> Result<Reply, BusError> {
        self.transfer(Command::Brd, Target::Broadcast(register), vec![0; length], None).await
    }

    /// Writes registers of all SubDevices.
    pub async fn bwr(&self, register: RegisterAddress, data: &[u8]) -> Result<Reply, BusError> {
        self.transfer(Command::Bwr, Target::Broadcast(register), data.to_vec(), None).await
    }

    /// Reads registers of the SubDevice at a position, which must answer.
    pub async fn aprd(
        &self,
        position: Position,
        register: RegisterAddress,
        length: usize,
    ) -> Result<Vec<u8>, BusError> {
        self.one(Command::Aprd, Target::Position(position, register), vec![0; length]).await
    }

    /// Writes registers of the SubDevice at a position, which must answer.
    pub async fn apwr(&self, position: Position, register: RegisterAddress, data: &[u8]) -> Result<(), BusError> {
        self.one(Command::Apwr, Target::Position(position, register), data.to_vec()).await.map(drop)
    }

    /// Reads registers of a SubDevice, which must answer.
    pub async fn fprd(
        &self,
        station: StationAddress,
        register: RegisterAddress,
        length: usize,
    ) -> Result<Vec<u8>, BusError> {
        self.one(Command::Fprd, Target::Station(station, register), vec![0; length]).await
    }

    /// Reads `N` bytes of registers of a SubDevice, which must answer.
    pub async fn fprd_array<const N: usize>(
        &self,
        station: StationAddress,
        register: RegisterAddress,
    ) -> Result<[u8; N], BusError> {
        let data = self.fprd(station, register, N).await?;
        let mut array = [0; N];
        array.copy_from_slice(&data[..N]);
        Ok(array)
    }

    /// Writes registers of a SubDevice, which must answer.
    pub async fn fpwr(&self, station: StationAddress, register: RegisterAddress, data: &[u8]) -> Result<(), BusError> {
        self.one(Command::Fpwr, Target::Station(station, register), data.to_vec()).await.map(drop)
    }

    /// The same before all datagrams that wait, those of other procedures to this SubDevice included.
    pub(crate) async fn fpwr_first(
        &self,
        station: StationAddress,
        register: RegisterAddress,
        data: &[u8],
    ) -> Result<(), BusError> {
        let (target, expected) = (Target::Station(station, register), Wkc(1));
        let request = Request::once(Command::Fpwr, target, data.to_vec());
        let request = Request { expected: Some(expected), resend: true, urgent: true, ..request };
        let got = self.submit(request).await?.wkc();
        if got == expected { Ok(()) } else { Err(BusError::Wkc { target, expected, got }) }
    }

    async fn one(&self, command: Command, target: Target, data: Vec<u8>) -> Result<Vec<u8>, BusError> {
        let expected = Wkc(1);
        let reply = self.transfer(command, target, data, Some(expected)).await?;
        if reply.wkc() == expected { Ok(reply.data) } else { Err(BusError::Wkc { target, expected, got: reply.wkc() }) }
    }
}
