//! The mailbox gateway on the loopback: clients over UDP and TCP beside our own traffic, and clients that behave badly.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream, UdpSocket};
use std::ops::ControlFlow;
use std::path::Path;
use std::thread::{self, sleep};
use std::time::{Duration, Instant};

use ringcat::gateway::{Gateway, GatewayOptions};
use ringcat::shared_segment::SharedSegment;
use ringcat::{CyclicThread, Error, Limits, Options, SubDeviceId, SupervisorThread, TransferLimits, automatic};
use ringcat_sim::network::Network;
use ringcat_sim::segment::Segment;
use ringcat_wire::mailbox::foe::FoeMessage;
use ringcat_wire::mailbox::sdo::{AbortCode, SdoRequest, SdoResponse};
use ringcat_wire::mailbox::{ErrorReply, Header, Message, Protocol, gateway};

const SEGMENT: &str = "[segment]\nring = true\n[[device]]\ntype = \"coupler\"\n[[device]]\ntype = \"all-protocols\"\n\
                       [[device]]\ntype = \"digital-output-8\"\n";
const PERIOD: Duration = Duration::from_millis(2);
const LIMIT: Duration = Duration::from_secs(30);
const LIMITS: Limits = Limits::new(Duration::from_secs(5), Duration::from_secs(10));
const TRANSFER: TransferLimits = TransferLimits::new(LIMITS.request, LIMITS.answer);
/// The SubDevice with all protocols, by index and by station address.
const ALL: usize = 1;
const NUMBER: u16 = 0x2001;
const LARGE: u16 = 0x2002;
const MAILBOX: usize = 1024;

struct Bench {
    station: u16,
    terminal: u16,
    gateway: Gateway,
    cycles: CyclicThread<SharedSegment>,
}

impl Bench {
    fn new(connections: usize) -> Bench {
        Bench::start(connections).expect("a segment in OP and a gateway")
    }

    fn start(connections: usize) -> Result<Bench, Error> {
        let segment = Segment::from_toml(SEGMENT, Path::new(".")).expect("a good segment");
        let (cyclic, acyclic) = SharedSegment::halves(Network::from_description(segment).expect("it can be built"));
        let supervisor = SupervisorThread::start(acyclic, &Options::default(), || ())?;
        let address = SocketAddr::from(([127, 0, 0, 1], 0));
        let gateway = supervisor.start_gateway(GatewayOptions::at(address).with_connections(connections))?;
        let scan = supervisor.scan()?;
        let application = supervisor.activate(automatic(&scan.subdevices, PERIOD), cyclic)?;
        let cycles = application.start_cycles(|| (), |_| ControlFlow::Continue(()))?;
        let bench =
            Bench { station: scan.subdevices[ALL].station.0, terminal: scan.subdevices[2].station.0, gateway, cycles };
        bench.wait("all are in OP", |bench| bench.cycles.supervisor().all_settled());
        Ok(bench)
    }

    fn wait(&self, what: &str, condition: impl Fn(&Bench) -> bool) {
        let end = Instant::now() + LIMIT;
        while !condition(self) {
            assert!(Instant::now() < end, "{what}: {:?}", self.gateway.counters());
            sleep(Duration::from_millis(1));
        }
    }

    fn tcp(&self) -> Client {
        let stream = TcpStream::connect(self.gateway.address()).expect("it listens");
        stream.set_read_timeout(Some(LIMIT)).expect("a timeout");
        Client { socket: Socket::Tcp(stream), station: self.station, counter: 0 }
    }

    fn udp(&self) -> Client {
        let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
        socket.connect(self.gateway.address()).expect("it listens");
        socket.set_read_timeout(Some(LIMIT)).expect("a timeout");
        Client { socket: Socket::Udp(socket), station: self.station, counter: 0 }
    }

    /// Our own traffic works.
    fn own_traffic(&self, value: u16) {
        let supervisor = self.cycles.supervisor();
        let mailbox_device = supervisor.subdevice(SubDeviceId(ALL)).limits(TRANSFER);
        mailbox_device.sdo_write(NUMBER, 200, value).expect("it can be written");
        assert_eq!(mailbox_device.sdo_read::<u16>(NUMBER, 200).expect("it can be read"), value);
    }
}

enum Socket {
    Tcp(TcpStream),
    Udp(UdpSocket),
}

struct Client {
    socket: Socket,
    station: u16,
    counter: u8,
}

fn message(station: u16, counter: u8, protocol: Protocol, payload: &[u8]) -> Vec<u8> {
    let header = Header { address: station, ..Header::new(protocol, counter, payload.len() as u16) };
    let mut bytes = vec![0; gateway::HEADER_LEN + Header::LEN + payload.len()];
    gateway::encode(&Message { header, payload }, &mut bytes).expect("it fits");
    bytes
}

impl Client {
    fn send(&mut self, bytes: &[u8]) {
        match &mut self.socket {
            Socket::Tcp(stream) => stream.write_all(bytes).expect("it is there"),
            Socket::Udp(socket) => drop(socket.send(bytes).expect("it is there")),
        }
    }

    fn receive(&mut self) -> (Header, Vec<u8>) {
        let mut bytes = [0; 4096];
        let length = match &mut self.socket {
            Socket::Tcp(stream) => {
                stream.read_exact(&mut bytes[..2]).expect("an answer");
                let length = gateway::frame_length([bytes[0], bytes[1]]).expect("type 5");
                stream.read_exact(&mut bytes[2..length]).expect("the whole answer");
                length
            }
            Socket::Udp(socket) => socket.recv(&mut bytes).expect("an answer"),
        };
        let message = gateway::decode(&bytes[..length]).expect("a message");
        (message.header, message.payload.to_vec())
    }

    fn ask(&mut self, protocol: Protocol, payload: &[u8]) -> (Protocol, Vec<u8>) {
        self.counter = self.counter % 7 + 1;
        self.send(&message(self.station, self.counter, protocol, payload));
        let (header, answer) = self.receive();
        assert_eq!((header.address, header.counter), (self.station, self.counter), "as the client used them");
        (header.protocol, answer)
    }

    fn sdo<T>(&mut self, request: SdoRequest<'_>, read: impl FnOnce(SdoResponse<'_>) -> T) -> T {
        let mut payload = vec![0; MAILBOX - Header::LEN];
        let length = request.encode(&mut payload).expect("it fits");
        let (protocol, answer) = self.ask(Protocol::Coe, &payload[..length]);
        assert_eq!(protocol, Protocol::Coe, "{answer:?}");
        read(SdoResponse::decode(&answer).expect("an SDO"))
    }

    fn write(&mut self, sub_index: u8, value: u16) {
        let data = &value.to_le_bytes();
        let request = SdoRequest::DownloadExpedited { index: NUMBER, sub_index, complete_access: false, data };
        self.sdo(request, |response| assert_eq!(response, SdoResponse::DownloadDone { index: NUMBER, sub_index }));
    }

    fn read(&mut self, sub_index: u8) -> u16 {
        let request = SdoRequest::Upload { index: NUMBER, sub_index, complete_access: false };
        self.sdo(request, |response| match response {
            SdoResponse::UploadExpedited { data, .. } => u16::from_le_bytes(data.try_into().expect("two bytes")),
            other => panic!("{other:?}"),
        })
    }

    /// The first message of a large upload.
    fn begin_upload(&mut self) -> Vec<u8> {
        let request = SdoRequest::Upload { index: LARGE, sub_index: 0, complete_access: false };
        self.sdo(request, |response| match response {
            SdoResponse::UploadNormal { total: 100_000, data, .. } => data.to_vec(),
            other => panic!("{other:?}"),
        })
    }

    fn upload(&mut self) -> Vec<u8> {
        let mut data = self.begin_upload();
        let mut toggle = false;
        loop {
            let last = self.sdo(SdoRequest::UploadSegment { toggle }, |response| match response {
                SdoResponse::UploadSegment { last, data: segment, .. } => {
                    data.extend_from_slice(segment);
                    last
                }
                other => panic!("{other:?}"),
            });
            toggle = !toggle;
            if last {
                return data;
            }
        }
    }

    fn foe(&mut self, message: FoeMessage<'_>) -> Vec<u8> {
        let mut payload = vec![0; MAILBOX - Header::LEN];
        let length = message.encode(&mut payload).expect("it fits");
        let (protocol, answer) = self.ask(Protocol::Foe, &payload[..length]);
        assert_eq!(protocol, Protocol::Foe, "{answer:?}");
        answer
    }

    fn write_file(&mut self, name: &str, data: &[u8]) {
        let full = FoeMessage::max_data(MAILBOX);
        let mut message = FoeMessage::Write { password: 0, name: name.as_bytes() };
        let mut rest = data;
        for packet in 0.. {
            let answer = self.foe(message);
            assert_eq!(FoeMessage::decode(&answer), Ok(FoeMessage::Acknowledge { packet }));
            if matches!(message, FoeMessage::Data { data, .. } if data.len() < full) {
                return;
            }
            let (piece, more) = rest.split_at(rest.len().min(full));
            (message, rest) = (FoeMessage::Data { packet: packet + 1, data: piece }, more);
        }
    }

    fn read_file(&mut self, name: &str) -> Vec<u8> {
        let mut file = Vec::new();
        let mut answer = self.foe(FoeMessage::Read { password: 0, name: name.as_bytes() });
        for expected in 1.. {
            let FoeMessage::Data { packet, data } = FoeMessage::decode(&answer).expect("a packet") else {
                panic!("{answer:?}")
            };
            assert_eq!(packet, expected);
            file.extend_from_slice(data);
            if data.len() < FoeMessage::max_data(MAILBOX) {
                break;
            }
            answer = self.foe(FoeMessage::Acknowledge { packet });
        }
        let mut payload = [0; 6];
        let end = FoeMessage::Acknowledge { packet: (file.len() / FoeMessage::max_data(MAILBOX)) as u32 + 1 };
        end.encode(&mut payload);
        self.send(&message(self.station, 7, Protocol::Foe, &payload));
        file
    }

    /// The detail of the error reply to a message.
    fn refused(&mut self, bytes: &[u8]) -> u16 {
        self.send(bytes);
        let (header, answer) = self.receive();
        assert_eq!(header.protocol, Protocol::Error);
        ErrorReply::decode(answer.first_chunk().expect("an error reply")).detail
    }
}

// covers: 10.1, gateway
#[test]
fn several_clients_and_our_own_traffic_share_a_mailbox_and_none_disturbs_another() {
    let bench = Bench::new(8);
    thread::scope(|scope| {
        for number in 0..4u16 {
            let mut client = if number % 2 == 0 { bench.tcp() } else { bench.udp() };
            scope.spawn(move || {
                for round in 0..10 {
                    let sub_index = number as u8 + 1;
                    client.write(sub_index, number << 8 | round);
                    assert_eq!(client.read(sub_index), number << 8 | round);
                }
            });
        }
        for mut client in [bench.tcp(), bench.udp()] {
            scope.spawn(move || {
                let data = client.upload();
                assert_eq!(data.len(), 100_000);
                assert!(
                    data.iter().enumerate().all(|(at, byte)| *byte == (at % 251) as u8),
                    "segments of one transfer"
                );
            });
        }
        let mut client = bench.udp();
        scope.spawn(move || {
            // A multiple of what a packet carries.
            let data: Vec<u8> = (0..20 * FoeMessage::max_data(MAILBOX)).map(|at| (at % 249) as u8).collect();
            client.write_file("recipe", &data);
            assert!(client.read_file("recipe") == data);
        });
        for round in 0..5 {
            bench.own_traffic(0x5A00 + round);
            let mailbox_device =
                bench.cycles.supervisor().subdevice(SubDeviceId(ALL)).limits(TRANSFER.with_bytes(200_000));
            let large = mailbox_device.sdo_read::<Vec<u8>>(LARGE, 0);
            assert_eq!(large.expect("no other message is in this transfer").len(), 100_000);
        }
    });
    let counters = bench.gateway.counters();
    println!("{counters:?}");
    assert_eq!((counters.relay.refused, counters.relay.unanswered, counters.relay.ended), (0, 0, 0), "{counters:?}");
    assert_eq!((counters.connections, counters.ended, counters.dropped), (3, 0, 0), "{counters:?}");
}

// covers: 10.1, own-objects
#[test]
fn at_address_0_are_the_objects_of_the_main_device() {
    let bench = Bench::new(8);
    for mut client in [bench.tcp(), bench.udp()] {
        client.station = 0;
        let name = SdoRequest::Upload { index: 0x1008, sub_index: 0, complete_access: false };
        client.sdo(name, |response| {
            assert!(matches!(response, SdoResponse::UploadNormal { data: b"RingCAT", total: 7, .. }), "{response:?}");
        });
        // The AL status of the SubDevice with all protocols.
        let status = SdoRequest::Upload { index: 0xA000 + ALL as u16, sub_index: 1, complete_access: false };
        client.sdo(status, |response| {
            assert!(matches!(response, SdoResponse::UploadExpedited { data: [8, 0], .. }), "{response:?}");
        });
    }
}

// covers: 10.1, own-objects
#[test]
fn before_activation_address_0_has_the_objects_that_need_no_declaration() {
    let segment = Segment::from_toml(SEGMENT, Path::new(".")).expect("a good segment");
    let (_, acyclic) = SharedSegment::halves(Network::from_description(segment).expect("it can be built"));
    let supervisor = SupervisorThread::start(acyclic, &Options::default(), || ()).expect("a thread");
    let address = SocketAddr::from(([127, 0, 0, 1], 0));
    let gateway = supervisor.start_gateway(GatewayOptions::at(address).with_connections(1)).expect("a free port");
    let stream = TcpStream::connect(gateway.address()).expect("it listens");
    stream.set_read_timeout(Some(LIMIT)).expect("a timeout");
    let mut client = Client { socket: Socket::Tcp(stream), station: 0, counter: 0 };
    let upload = |index| SdoRequest::Upload { index, sub_index: 0, complete_access: false };
    client.sdo(upload(0xF020), |response| {
        assert!(matches!(response, SdoResponse::UploadExpedited { data: [0], .. }), "{response:?}");
    });
    client.sdo(upload(0x8000), |response| {
        let code = AbortCode::OBJECT_DOES_NOT_EXIST;
        assert_eq!(response, SdoResponse::Abort { index: 0x8000, sub_index: 0, code });
    });
}

// covers: 10.1, gateway
#[test]
fn what_cannot_be_passed_on_is_answered_with_an_error_reply() {
    let bench = Bench::new(8);
    let mut client = bench.udp();
    let upload = [0x00, 0x20, 0x40, 0x01, 0x20, 0x01, 0, 0, 0, 0];
    let station = bench.station;
    assert_eq!(
        client.refused(&message(0, 1, Protocol::Foe, &upload)),
        ErrorReply::UNSUPPORTED_PROTOCOL,
        "objects only"
    );
    assert_eq!(client.refused(&message(0x4711, 1, Protocol::Coe, &upload)), ErrorReply::INVALID_HEADER, "no SubDevice");
    assert_eq!(client.refused(&message(bench.terminal, 1, Protocol::Coe, &upload)), ErrorReply::UNSUPPORTED_PROTOCOL);
    assert_eq!(client.refused(&message(station, 1, Protocol::Other(9), &upload)), ErrorReply::UNSUPPORTED_PROTOCOL);
    assert_eq!(client.refused(&message(station, 1, Protocol::Eoe, &[0; 64])), ErrorReply::SERVICE_NOT_SUPPORTED);
    assert_eq!(client.refused(&message(station, 1, Protocol::Coe, &[0, 0x20])), ErrorReply::SIZE_TOO_SHORT);
    let mut long = upload.to_vec();
    long.resize(1500, 0);
    assert_eq!(client.refused(&message(station, 1, Protocol::Coe, &long)), ErrorReply::INVALID_SIZE);
    // An abort of the SubDevice is an answer.
    let absent = SdoRequest::Upload { index: 0x7777, sub_index: 0, complete_access: false };
    client.sdo(absent, |response| assert!(matches!(response, SdoResponse::Abort { .. }), "{response:?}"));
    bench.own_traffic(1);
}

// covers: gateway
#[test]
fn a_client_that_leaves_during_a_transfer_loses_only_that_transfer() {
    let bench = Bench::new(8);
    let (mut leaving, mut pausing, mut patient) = (bench.tcp(), bench.udp(), bench.tcp());
    leaving.begin_upload();
    let begin = Instant::now();
    drop(leaving);
    bench.own_traffic(2);
    assert!(begin.elapsed() < Duration::from_millis(900), "{:?}", begin.elapsed());
    // Over UDP its end is not visible.
    pausing.begin_upload();
    let begin = Instant::now();
    patient.write(3, 0x33);
    assert!(begin.elapsed() < Duration::from_secs(10), "{:?}", begin.elapsed());
    assert_eq!(bench.gateway.counters().relay.ended, 2);
    // It may begin again; a segment of the old transfer is refused by the SubDevice.
    pausing.sdo(SdoRequest::UploadSegment { toggle: false }, |response| {
        assert!(matches!(response, SdoResponse::Abort { .. }), "{response:?}");
    });
    assert_eq!(pausing.upload().len(), 100_000);
    assert_eq!(patient.read(3), 0x33);
}

// covers: gateway
#[test]
fn garbage_half_messages_floods_and_clients_that_do_not_read_hurt_only_themselves() {
    let bench = Bench::new(3);
    let mut good = bench.tcp();
    good.write(1, 1);
    // No message: the connection ends.
    let mut garbage = bench.tcp();
    garbage.send(b"GET / HTTP/1.0\r\n\r\n");
    let Socket::Tcp(stream) = &mut garbage.socket else { unreachable!() };
    assert!(matches!(stream.read(&mut [0; 8]), Ok(0) | Err(_)), "it is cut off");
    // As datagrams, they are dropped.
    let mut datagrams = bench.udp();
    for bytes in
        [&b""[..], b"x", b"\x08\x10\0\0\0\0\0\0\0\0", &[0xFF; 100], &message(bench.station, 1, Protocol::Coe, &[])[..7]]
    {
        datagrams.send(bytes);
    }
    // A message in pieces is as good as any, and half of one delays no other client.
    let mut half = bench.tcp();
    let whole = message(bench.station, 5, Protocol::Coe, &[0x00, 0x20, 0x40, 0x01, 0x20, 0x01, 0, 0, 0, 0]);
    for byte in &whole[..whole.len() - 1] {
        half.send(std::slice::from_ref(byte));
    }
    good.write(2, 2);
    half.send(&whole[whole.len() - 1..]);
    assert_eq!(half.receive().0.counter, 5);
    half.send(&whole[..7]);
    // A flood without a reader of its answers.
    let flood = bench.tcp();
    let Socket::Tcp(mut stream) = flood.socket else { unreachable!() };
    let begin = Instant::now();
    stream.set_write_timeout(Some(Duration::from_millis(50))).expect("a timeout");
    let many = whole.repeat(200);
    let mut cut_off = false;
    while begin.elapsed() < Duration::from_millis(500) && !cut_off {
        let error = stream.write_all(&many).err().map(|error| error.kind());
        cut_off =
            error.is_some_and(|kind| !matches!(kind, std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut));
        good.write(1, 7);
    }
    println!("flood: cut off {cut_off} after {:?}; {:?}", begin.elapsed(), bench.gateway.counters());
    assert_eq!((good.read(1), good.read(2)), (7, 2));
    bench.own_traffic(3);
    // The last two are still there: a fourth is one too many.
    drop(stream);
    let counters = bench.gateway.counters();
    assert!(counters.relay.malformed >= 4 && counters.relay.refused > 0, "{counters:?}");
    bench.wait("the half message is given up", |bench| bench.gateway.counters().ended >= 2);
}
