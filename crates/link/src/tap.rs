//! TAP interfaces: network interfaces of this host whose other end is this process.
//!
//! [`TapInterface::receive`] returns the Ethernet frames that the host sends on the interface; the host receives the
//! frames of [`TapInterface::send`]. An interface exists as long as its value and the duplicates of its descriptor that
//! other processes have, or until it is removed ([`TapInterface::create_lasting`]). The administrator of the host
//! switches it on, assigns addresses and bridges it (`ip link set NAME up`). Without a carrier the host sends nothing.
//!
//! Creating one needs CAP_NET_ADMIN; reading and writing do not. Constants are those of `linux/if_tun.h`.

use std::error::Error;
use std::ffi::CStr;
use std::fmt;
use std::io;
use std::mem::size_of;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, FromRawFd, OwnedFd};

use crate::kernel::{self, errno};
use crate::permission;

const DEVICE: &CStr = c"/dev/net/tun";
const TUNSETIFF: libc::c_ulong = 0x4004_54CA;
const TUNSETCARRIER: libc::c_ulong = 0x4004_54E2;
const TUNGETIFF: libc::c_ulong = 0x8004_54D2;
const TUNSETPERSIST: libc::c_ulong = 0x4004_54CB;
/// Bytes of a MAC address in `sockaddr`.
const MAC_LEN: usize = 6;
/// Length of the host's transmit queue. Further frames are dropped, so that connections of the host notice congestion
/// in time.
const QUEUE: libc::c_int = 64;

/// Why the interface cannot be created, with advice.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum TapError {
    /// This process may not create network interfaces.
    Permission {
        /// The interface that was to be made.
        name: String,
    },
    /// The kernel has no TAP interfaces, or `/dev/net/tun` is not visible to this process.
    NoDevice {
        /// The error number of the kernel.
        errno: i32,
    },
    /// An interface of this name exists, or another program has it open.
    Taken {
        /// The name.
        name: String,
    },
    /// A process that makes interfaces for this one refuses.
    Refused {
        /// The interface.
        name: String,
        /// Reason of the refusal.
        cause: String,
    },
    /// Another system call error.
    Os {
        /// The interface.
        name: String,
        /// The failed operation.
        what: &'static str,
        /// The error number of the kernel.
        errno: i32,
    },
}

impl TapError {
    fn from_errno(name: &str, what: &'static str, errno: i32) -> TapError {
        let name = name.to_owned();
        match errno {
            libc::EPERM | libc::EACCES => TapError::Permission { name },
            libc::EBUSY | libc::EEXIST | libc::EINVAL => TapError::Taken { name },
            errno => TapError::Os { name, what, errno },
        }
    }
}

impl fmt::Display for TapError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TapError::Permission { name } => write!(
                f,
                "not permitted to make the network interface {name}; run as root or permit it once with\n  {}",
                permission::setcap_command()
            ),
            TapError::NoDevice { errno } => write!(
                f,
                "no network interfaces can be made: /dev/net/tun: {}; try `sudo modprobe tun`, in a container \
                 `--device /dev/net/tun`",
                io::Error::from_raw_os_error(*errno)
            ),
            TapError::Taken { name } => {
                write!(f, "there is an interface {name} already: another MainDevice with this number? See `ip link`")
            }
            TapError::Refused { name, cause } => write!(f, "{name}: {cause}"),
            TapError::Os { name, what, errno } => {
                write!(f, "{name}: {what}: {}", io::Error::from_raw_os_error(*errno))
            }
        }
    }
}

impl Error for TapError {}

/// A TAP interface.
#[derive(Debug)]
pub struct TapInterface {
    fd: OwnedFd,
    name: String,
}

impl AsFd for TapInterface {
    /// Readable while frames of the host wait.
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.fd.as_fd()
    }
}

impl TapInterface {
    /// Creates an interface with this name and address, switched off and without a carrier, in the network namespace of
    /// the calling thread.
    ///
    /// # Errors
    /// A missing permission or device, or a name that is taken.
    pub fn create(name: &str, mac: [u8; MAC_LEN]) -> Result<TapInterface, TapError> {
        let tap = TapInterface::open(name, libc::IFF_TUN_EXCL)?;
        tap.set_up(mac)?;
        Ok(tap)
    }

    /// The same for an interface that outlasts this process: an existing one with this name that no process has open is
    /// used as it is. It is removed by [`TapInterface::end_with_processes`], or by `ip link del`.
    ///
    /// # Errors
    /// As [`TapInterface::create`]; another process has it open.
    pub fn create_lasting(name: &str, mac: [u8; MAC_LEN]) -> Result<TapInterface, TapError> {
        let is_left = kernel::index_of(name).is_some();
        let tap = TapInterface::open(name, 0)?;
        if !is_left {
            tap.set_up(mac)?;
        }
        let kept = set_lasting(&tap.fd, true);
        kept.map_err(|errno| TapError::from_errno(name, "making it last", errno))?;
        Ok(tap)
    }

    /// From now on it exists as long as a process has it.
    pub fn end_with_processes(&self) {
        // This fails only if the interface was removed meanwhile.
        let _ = set_lasting(&self.fd, false);
    }

    /// An interface whose descriptor another process has passed on. No privilege is needed.
    ///
    /// # Errors
    /// The descriptor is not that of a TAP interface.
    pub fn adopt(fd: OwnedFd) -> Result<TapInterface, TapError> {
        let failed = |errno| TapError::from_errno("a descriptor", "going on with an interface", errno);
        // The kernel writes the whole of it.
        let mut request = kernel::named("any").map_err(failed)?;
        ioctl(&fd, TUNGETIFF, &mut request).map_err(failed)?;
        // SAFETY: the request has filled this member.
        let flags = libc::c_int::from(unsafe { request.ifr_ifru.ifru_flags });
        if flags & libc::IFF_TAP == 0 {
            return Err(failed(libc::ENOTTY));
        }
        let name: Vec<u8> = request.ifr_name.iter().take_while(|it| **it != 0).map(|it| it.to_ne_bytes()[0]).collect();
        Ok(TapInterface { fd, name: String::from_utf8_lossy(&name).into_owned() })
    }

    /// A duplicate, for another part of this process or another process.
    ///
    /// # Errors
    /// The process has no more descriptors.
    pub fn duplicate(&self) -> io::Result<TapInterface> {
        Ok(TapInterface { fd: self.fd.try_clone()?, name: self.name.clone() })
    }

    /// Opens the device, and makes an interface or finds it.
    fn open(name: &str, flags: libc::c_int) -> Result<TapInterface, TapError> {
        // SAFETY: the path is a null-terminated string.
        let fd = unsafe { libc::open(DEVICE.as_ptr(), libc::O_RDWR | libc::O_NONBLOCK | libc::O_CLOEXEC) };
        if fd < 0 {
            return Err(match errno() {
                libc::EPERM | libc::EACCES => TapError::Permission { name: name.to_owned() },
                errno => TapError::NoDevice { errno },
            });
        }
        // SAFETY: the descriptor was just made and has no other owner.
        let fd = unsafe { OwnedFd::from_raw_fd(fd) };
        let failed = |what, errno| TapError::from_errno(name, what, errno);
        let mut request = kernel::named(name).map_err(|errno| failed("its name", errno))?;
        request.ifr_ifru.ifru_flags = (libc::IFF_TAP | libc::IFF_NO_PI | flags) as libc::c_short;
        ioctl(&fd, TUNSETIFF, &mut request).map_err(|errno| failed("making it", errno))?;
        Ok(TapInterface { fd, name: name.to_owned() })
    }

    /// A new interface has its address and queue, and no carrier.
    fn set_up(&self, mac: [u8; MAC_LEN]) -> Result<(), TapError> {
        let failed = |what| move |errno| TapError::from_errno(&self.name, what, errno);
        self.set_mac(mac).map_err(failed("setting its address"))?;
        self.set_queue().map_err(failed("setting its queue"))?;
        self.set_carrier(false);
        Ok(())
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Sets the carrier of the interface. False if the kernel does not support it (before Linux 5.0).
    pub fn set_carrier(&self, carrier: bool) -> bool {
        let mut value = libc::c_int::from(carrier);
        ioctl(&self.fd, TUNSETCARRIER, &mut value).is_ok()
    }

    /// Whether it still exists: another program may have deleted it (`ip link del`).
    pub fn exists(&self) -> bool {
        kernel::named(&self.name).is_ok_and(|mut request| ioctl(&self.fd, TUNGETIFF, &mut request).is_ok())
    }

    /// Whether it is switched on. Works in any network namespace, without a permission (since Linux 5.2).
    pub fn is_up(&self) -> bool {
        let mut polled = [libc::pollfd { fd: self.fd.as_raw_fd(), events: libc::POLLOUT, revents: 0 }];
        // The kernel reports room for frames only while the interface is up.
        kernel::poll(&mut polled, libc::timespec { tv_sec: 0, tv_nsec: 0 });
        polled[0].revents & (libc::POLLOUT | libc::POLLERR) == libc::POLLOUT
    }

    fn set_mac(&self, mac: [u8; MAC_LEN]) -> Result<(), i32> {
        let mut request = kernel::named(&self.name)?;
        let mut address = libc::sockaddr { sa_family: libc::ARPHRD_ETHER, sa_data: [0; 14] };
        for (to, from) in address.sa_data.iter_mut().zip(mac) {
            *to = from as libc::c_char;
        }
        request.ifr_ifru.ifru_hwaddr = address;
        ioctl(&self.fd, libc::SIOCSIFHWADDR as _, &mut request)
    }

    /// Shortens the transmit queue, which by default holds one second of frames.
    fn set_queue(&self) -> Result<(), i32> {
        let mut request = kernel::named(&self.name)?;
        // The queue length and the MTU are the same integer of the union (`ifr_qlen`, `ifr_mtu`).
        request.ifr_ifru.ifru_mtu = QUEUE;
        ioctl(&kernel::request_socket()?, libc::SIOCSIFTXQLEN as _, &mut request)
    }

    /// Sets its MTU.
    ///
    /// # Errors
    /// The kernel refuses it.
    pub fn set_mtu(&self, mtu: u16) -> Result<(), TapError> {
        let set = || {
            let mut request = kernel::named(&self.name)?;
            request.ifr_ifru.ifru_mtu = mtu.into();
            ioctl(&kernel::request_socket()?, libc::SIOCSIFMTU as _, &mut request)
        };
        set().map_err(|errno| TapError::from_errno(&self.name, "setting its MTU", errno))
    }

    /// Takes the oldest frame that the host sent on the interface and returns its length; `None` if there is none. A
    /// frame longer than `room` is truncated.
    pub fn receive(&self, room: &mut [u8]) -> Option<usize> {
        // SAFETY: pointer and length describe live memory that the kernel writes.
        let count = unsafe { libc::read(self.fd.as_raw_fd(), room.as_mut_ptr().cast(), room.len()) };
        usize::try_from(count).ok().filter(|count| *count > 0)
    }

    /// Sends a frame to the host. False if the host does not accept it: the interface is switched off, or memory is
    /// short.
    pub fn send(&self, frame: &[u8]) -> bool {
        // SAFETY: pointer and length describe live memory that the kernel only reads.
        let count = unsafe { libc::write(self.fd.as_raw_fd(), frame.as_ptr().cast(), frame.len()) };
        usize::try_from(count).is_ok_and(|count| count == frame.len())
    }
}

/// Argument types of requests to TAP descriptors.
///
/// # Safety
/// Only for types that the kernel reads and writes in full size.
unsafe trait Argument {}
// SAFETY: the argument of TUNSETIFF, TUNGETIFF, SIOCSIFHWADDR and SIOCSIFTXQLEN.
unsafe impl Argument for libc::ifreq {}
// SAFETY: the argument of TUNSETCARRIER.
unsafe impl Argument for libc::c_int {}

const _: () = assert!(size_of::<libc::c_int>() == 4, "the size is part of the request's number");

/// Whether an interface outlasts its processes.
fn set_lasting(fd: &OwnedFd, lasting: bool) -> Result<(), i32> {
    // SAFETY: the argument of this request is a number, not a pointer.
    let result = unsafe { libc::ioctl(fd.as_raw_fd(), TUNSETPERSIST as _, libc::c_ulong::from(lasting)) };
    if result < 0 { Err(errno()) } else { Ok(()) }
}

fn ioctl<T: Argument>(fd: &OwnedFd, request: libc::c_ulong, argument: &mut T) -> Result<(), i32> {
    // SAFETY: the argument is live and of the type that the request takes (`Argument`).
    let result = unsafe { libc::ioctl(fd.as_raw_fd(), request as _, std::ptr::from_mut(argument)) };
    if result < 0 { Err(errno()) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: eoe-interfaces
    #[test]
    fn an_error_of_creating_an_interface_names_the_remedy() {
        let text = TapError::from_errno("eoe0s1", "making it", libc::EPERM).to_string();
        assert!(
            text.starts_with("not permitted to make the network interface eoe0s1") && text.contains("setcap"),
            "{text}"
        );
        let text = TapError::from_errno("eoe0s1", "making it", libc::EBUSY).to_string();
        assert!(text.contains("an interface eoe0s1 already"), "{text}");
        let text = TapError::NoDevice { errno: libc::ENOENT }.to_string();
        assert!(text.contains("/dev/net/tun: No such file") && text.contains("modprobe tun"), "{text}");
        let text = TapError::from_errno("eoe0s1", "making it", libc::ENOMEM).to_string();
        assert!(text.starts_with("eoe0s1: making it: "), "{text}");
    }
}
