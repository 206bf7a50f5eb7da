//! The codec at work: a frame is built, parsed back and compared.
//!
//! Functions are called through pointers that the optimiser cannot see through, so that they stay in the program.

use core::hint::black_box;

use ringcat_wire::address::{RegisterAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::frame::{Frame, FrameBuilder, FrameError, MIN_FRAME, MacAddress};

/// Whether a broadcast read of AL_STATUS comes back as it was written.
pub fn works() -> Option<()> {
    let mut buffer = [0; MIN_FRAME];
    let source = MacAddress(black_box([2, 0, 0, 0, 0, 1]));
    let mut builder = FrameBuilder::ethernet(&mut buffer, MacAddress::BROADCAST, source)?;
    let target = Target::Broadcast(RegisterAddress(0x0130));
    builder.datagram(Command::Brd, black_box(7), target, 2)?;
    let len = builder.finish();
    let parse = black_box(Frame::parse as fn(_) -> Result<_, FrameError>);
    let frame: Frame<'_> = parse(&buffer[..len]).ok()?;
    let datagram = frame.datagrams().next()?;
    (frame.source == source && datagram.header.index == 7 && datagram.wkc == Wkc(0)).then_some(())
}
