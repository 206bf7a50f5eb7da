//! The MainDevice ethercrab (from the registry) on a network interface, as an independent check of the simulator.
//!
//! `ethercrab_client INTERFACE SUBDEVICES CYCLES [TIMES]`: brings all SubDevices to OP and exchanges process data. In
//! cycle i byte j of the outputs of SubDevice k is i + k + j. The same number of cycles follows without other work, to
//! measure the cycle rate and the processor time per cycle. Prints one line of figures, with the measured propagation
//! delays, then keeps exchanging the last outputs until its standard input ends. Unexpected results end it with an
//! error. TIMES is the number of distributions of the reference time before OP; default is that of ethercrab.

use std::io;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use ethercrab::std::{ethercat_now, tx_rx_task};
use ethercrab::{MainDevice, MainDeviceConfig, PduStorage, Timeouts};
use ringcat_link::monotonic::process_cpu_ns;

/// Maximum number of SubDevices.
const SUBDEVICES: usize = 128;
/// Bytes of process data in both directions.
const PROCESS_DATA: usize = 4096;
/// Frames in flight.
const FRAMES: usize = 32;
/// Maximum length of a datagram's data, in bytes.
const DATAGRAM: usize = PduStorage::element_size(1100);
/// Time limit with a reserve for a busy machine.
const PATIENCE: Duration = Duration::from_millis(300);
/// Time limit from the first frame to OP of the last SubDevice.
const OP_LIMIT: Duration = Duration::from_secs(20);

static STORAGE: PduStorage<FRAMES, DATAGRAM> = PduStorage::new();

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, interface, numbers @ ..] = arguments.as_slice() else {
        eprintln!("usage: ethercrab_client INTERFACE SUBDEVICES CYCLES [TIMES]");
        return ExitCode::from(2);
    };
    let numbers: Result<Vec<usize>, _> = numbers.iter().map(|number| number.parse()).collect();
    let (count, cycles, config) = match numbers.as_deref() {
        Ok([count, cycles]) => (*count, *cycles, MainDeviceConfig::default()),
        Ok([count, cycles, times]) => {
            let config = MainDeviceConfig { dc_static_sync_iterations: *times as u32, ..MainDeviceConfig::default() };
            (*count, *cycles, config)
        }
        _ => {
            eprintln!("expected two or three numbers behind the interface");
            return ExitCode::from(2);
        }
    };
    match smol::block_on(run(interface, count, cycles, config)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// A MainDevice on an interface; a separate thread sends and receives its frames.
fn connect(interface: &str, config: MainDeviceConfig) -> Result<Arc<MainDevice<'static>>, String> {
    let (sender, receiver, pdu_loop) = STORAGE.try_split().map_err(|()| "the storage is in use".to_owned())?;
    let timeouts = Timeouts { pdu: PATIENCE, eeprom: PATIENCE, ..Timeouts::default() };
    let main_device = Arc::new(MainDevice::new(pdu_loop, timeouts, config));
    let task = tx_rx_task(interface, sender, receiver).map_err(|error| format!("{interface}: {error}"))?;
    thread::spawn(move || smol::block_on(task));
    Ok(main_device)
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Becomes true when the standard input ends.
fn end_of_input() -> Arc<AtomicBool> {
    let ended = Arc::new(AtomicBool::new(false));
    let end = ended.clone();
    thread::spawn(move || {
        // End and error of the input both end the program.
        let _ = io::copy(&mut io::stdin().lock(), &mut io::sink());
        end.store(true, Ordering::Relaxed);
    });
    ended
}

/// Outputs of a SubDevice: bytes that count up.
fn fill(outputs: &mut [u8], first: usize) {
    outputs.iter_mut().enumerate().for_each(|(at, byte)| *byte = (first + at) as u8);
}

fn median_us(times: &mut [Duration]) -> f64 {
    times.sort();
    times.get(times.len() / 2).copied().unwrap_or_default().as_secs_f64() * 1e6
}

async fn run(interface: &str, count: usize, cycles: usize, config: MainDeviceConfig) -> Result<(), String> {
    let main_device = connect(interface, config)?;
    let begin = Instant::now();
    let failed = |what: &'static str| move |error: ethercrab::error::Error| format!("{what}: {error}");
    let group =
        main_device.init_single_group::<SUBDEVICES, PROCESS_DATA>(ethercat_now).await.map_err(failed("scan"))?;
    if group.len() != count {
        return Err(format!("expected {count} SubDevices, found {}", group.len()));
    }
    let group = group.into_safe_op(&main_device).await.map_err(failed("SAFEOP"))?;
    // Outputs have to flow before SubDevices go to OP, and keep flowing.
    let group = group.request_into_op(&main_device).await.map_err(failed("OP"))?;
    while !group.tx_rx(&main_device).await.map_err(failed("first process data"))?.all_op() {
        if begin.elapsed() > OP_LIMIT {
            return Err(format!("not all SubDevices are in OP after {} s", OP_LIMIT.as_secs()));
        }
        smol::Timer::after(Duration::from_millis(1)).await;
    }
    let to_op = begin.elapsed();
    let mut round_trips = Vec::with_capacity(cycles);
    let (mut wkc, mut wrong) = (0, 0);
    for cycle in 0..cycles {
        for (position, subdevice) in group.iter(&main_device).enumerate() {
            fill(&mut subdevice.outputs_raw_mut(), cycle + position);
        }
        let sent = Instant::now();
        let response = group.tx_rx(&main_device).await.map_err(failed("process data"))?;
        round_trips.push(sent.elapsed());
        if cycle == 0 {
            wkc = response.working_counter;
        }
        wrong += usize::from(response.working_counter != wkc);
    }
    let (back_to_back, cpu_before) = (Instant::now(), process_cpu_ns());
    let (mut cycle_times, mut last) = (Vec::with_capacity(cycles), back_to_back);
    for _ in 0..cycles {
        group.tx_rx(&main_device).await.map_err(failed("process data"))?;
        cycle_times.push(last.elapsed());
        last = Instant::now();
    }
    let per_second = cycles as f64 / back_to_back.elapsed().as_secs_f64().max(f64::EPSILON);
    let cpu_us = (process_cpu_ns() - cpu_before) as f64 / 1e3 / cycles.max(1) as f64;
    let inputs: Vec<String> = group.iter(&main_device).map(|subdevice| hex(&subdevice.inputs_raw())).collect();
    let delays: Vec<String> =
        group.iter(&main_device).map(|subdevice| subdevice.propagation_delay().to_string()).collect();
    let [median, cycle] = [&mut round_trips, &mut cycle_times].map(|times| median_us(times));
    println!(
        "op_ms {} median_us {median:.1} per_second {per_second:.0} cycle_us {cycle:.2} cpu_us {cpu_us:.2} wkc {wkc} \
         wrong {wrong} delays {} inputs {}",
        to_op.as_millis(),
        delays.join(","),
        inputs.join(",")
    );
    let ended = end_of_input();
    while !ended.load(Ordering::Relaxed) {
        group.tx_rx(&main_device).await.map_err(failed("process data"))?;
        smol::Timer::after(Duration::from_millis(1)).await;
    }
    Ok(())
}
