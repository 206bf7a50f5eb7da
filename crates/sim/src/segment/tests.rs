use std::path::PathBuf;

use super::*;
use crate::cable::{DeviceIndex, Endpoint, HostLink};
use crate::frame::Port;
use crate::network::Network;

fn read(text: &str) -> Result<Segment, SegmentError> {
    Segment::from_toml(text, Path::new("nowhere"))
}

fn refused(text: &str) -> String {
    read(text).unwrap_err().to_string()
}

fn at(device: usize, port: Port) -> Endpoint {
    Endpoint::Device(DeviceIndex(device), port)
}

fn ends(segment: &Segment) -> Vec<(Endpoint, Endpoint)> {
    segment.cables.iter().map(|cable| (cable.a, cable.b)).collect()
}
