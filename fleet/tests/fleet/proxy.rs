//! A TCP relay that cuts, delays, throttles, and repeats attempts to connect.

use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

#[derive(Default)]
struct Faults {
    /// Nothing gets through, and no connection is accepted.
    is_cut: AtomicBool,
    delay_ms: AtomicU64,
    /// Bytes a second; 0: as fast as it goes.
    bytes_per_s: AtomicU64,
    /// What a client sends first is sent to the base once more, over a connection of its own.
    repeats: AtomicBool,
    n_repeated: AtomicU64,
    open: Mutex<Vec<TcpStream>>,
}

pub(crate) struct Proxy {
    pub(crate) port: u16,
    faults: Arc<Faults>,
}

impl Proxy {
    pub(crate) fn to(base_port: u16) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let faults = Arc::new(Faults::default());
        let shared = Arc::clone(&faults);
        let base = SocketAddr::from(([127, 0, 0, 1], base_port));
        std::thread::spawn(move || {
            for client in listener.incoming().flatten() {
                if shared.is_cut.load(Ordering::Relaxed) {
                    continue;
                }
                let Ok(server) = TcpStream::connect(base) else { continue };
                let mut open = shared.open.lock().unwrap();
                open.retain(|stream| stream.peer_addr().is_ok());
                open.extend([client.try_clone().unwrap(), server.try_clone().unwrap()]);
                drop(open);
                let ends = (client.try_clone().unwrap(), server.try_clone().unwrap());
                let [up, down] = [Arc::clone(&shared), Arc::clone(&shared)];
                std::thread::spawn(move || relay(client, server, &up, Some(base)));
                std::thread::spawn(move || relay(ends.1, ends.0, &down, None));
            }
        });
        Self { port, faults }
    }

    pub(crate) fn cut(&self) {
        self.faults.is_cut.store(true, Ordering::Relaxed);
        for stream in self.faults.open.lock().unwrap().drain(..) {
            let _ = stream.shutdown(Shutdown::Both);
        }
    }

    pub(crate) fn heal(&self) {
        self.faults.is_cut.store(false, Ordering::Relaxed);
    }

    pub(crate) fn slow(&self, delay_ms: u64, bytes_per_s: u64) {
        self.faults.delay_ms.store(delay_ms, Ordering::Relaxed);
        self.faults.bytes_per_s.store(bytes_per_s, Ordering::Relaxed);
    }

    pub(crate) fn repeat(&self, repeats: bool) {
        self.faults.repeats.store(repeats, Ordering::Relaxed);
    }

    pub(crate) fn n_repeated(&self) -> u64 {
        self.faults.n_repeated.load(Ordering::Relaxed)
    }
}

fn relay(mut from: TcpStream, mut to: TcpStream, faults: &Faults, base: Option<SocketAddr>) {
    let mut buffer = [0; 16 << 10];
    let mut is_first = true;
    while let Ok(n) = from.read(&mut buffer) {
        if n == 0 || faults.is_cut.load(Ordering::Relaxed) {
            break;
        }
        if let Some(base) = base.filter(|_| is_first && faults.repeats.load(Ordering::Relaxed))
            && let Ok(mut again) = TcpStream::connect(base)
        {
            let _ = again.write_all(&buffer[..n]);
            faults.n_repeated.fetch_add(1, Ordering::Relaxed);
        }
        is_first = false;
        std::thread::sleep(Duration::from_millis(faults.delay_ms.load(Ordering::Relaxed)));
        let rate = faults.bytes_per_s.load(Ordering::Relaxed);
        if rate > 0 {
            std::thread::sleep(Duration::from_secs_f64(n as f64 / rate as f64));
        }
        if to.write_all(&buffer[..n]).is_err() {
            break;
        }
    }
    let _ = from.shutdown(Shutdown::Both);
    let _ = to.shutdown(Shutdown::Both);
}
