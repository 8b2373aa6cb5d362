//! What the system says about this process: memory, processor time.

use std::time::{Duration, Instant};

/// The most memory that was ever resident, in bytes; `None` where the system does not tell.
///
/// Linux keeps the peak (`VmHWM`); elsewhere the present size stands in for it.
pub fn peak_resident_bytes() -> Option<u64> {
    status_bytes("VmHWM:").or_else(|| memory_stats::memory_stats().map(|m| m.physical_mem as u64))
}

/// The memory that is resident now, in bytes.
pub fn resident_bytes() -> Option<u64> {
    status_bytes("VmRSS:").or_else(|| memory_stats::memory_stats().map(|m| m.physical_mem as u64))
}

fn status_bytes(key: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    kilobytes(&status, key)
}

/// The value of a line such as `VmRSS:   1234 kB`, in bytes.
fn kilobytes(text: &str, key: &str) -> Option<u64> {
    let value = text.lines().find_map(|line| line.strip_prefix(key))?;
    value.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok().map(|kb| kb * 1024)
}

/// The memory that this process may still take without others being pushed out, in bytes: what the machine has
/// available, or what its control group leaves if that is less. `None` where the system does not tell.
pub fn available_bytes() -> Option<u64> {
    let machine = std::fs::read_to_string("/proc/meminfo").ok().and_then(|text| kilobytes(&text, "MemAvailable:"));
    let number = |path: &str| std::fs::read_to_string(path).ok()?.trim().parse::<u64>().ok();
    let group = |max: &str, now: &str| Some(number(max)?.saturating_sub(number(now)?));
    let v2 = group("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current");
    let v1 = group("/sys/fs/cgroup/memory/memory.limit_in_bytes", "/sys/fs/cgroup/memory/memory.usage_in_bytes");
    [machine, v2, v1].into_iter().flatten().min()
}

/// Gives freed memory back to the system where the allocator would keep it, so that [`resident_bytes`] tells what is
/// really in use.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[allow(unsafe_code)]
pub fn give_back_freed_memory() {
    // SAFETY: no argument, no precondition; thread-safe.
    unsafe { libc::malloc_trim(0) };
}

/// Nothing to be done here.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub fn give_back_freed_memory() {}

/// Processor time of all threads of this process so far.
pub fn process_cpu() -> Duration {
    clock(rustix::time::ClockId::ProcessCPUTime)
}

/// Processor time of the calling thread so far.
pub fn thread_cpu() -> Duration {
    clock(rustix::time::ClockId::ThreadCPUTime)
}

fn clock(id: rustix::time::ClockId) -> Duration {
    let time = rustix::time::clock_gettime(id);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

/// Wall and processor time since it was started, for the phases of a run.
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch {
    wall: Instant,
    cpu: Duration,
}

impl Stopwatch {
    /// Starts now.
    pub fn start() -> Self {
        Self { wall: Instant::now(), cpu: process_cpu() }
    }

    /// Wall seconds and processor seconds (of all threads) since the start.
    pub fn seconds(&self) -> (f64, f64) {
        (self.wall.elapsed().as_secs_f64(), (process_cpu() - self.cpu).as_secs_f64())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn peak_is_at_least_what_is_resident() {
        let ballast = vec![1u8; 32 << 20];
        let (now, peak) = (resident_bytes().unwrap(), peak_resident_bytes().unwrap());
        assert!(now > 32 << 20 && peak + (1 << 20) >= now, "{now} {peak} {}", ballast[0]);
    }

    #[test]
    fn the_machine_tells_what_it_has_left() {
        assert!(available_bytes().unwrap() > 1 << 20);
        give_back_freed_memory();
    }

    #[test]
    fn work_takes_processor_time_and_sleep_does_not() {
        let (watch, thread) = (Stopwatch::start(), thread_cpu());
        while thread_cpu() - thread < Duration::from_millis(20) {
            std::hint::spin_loop();
        }
        let (wall, cpu) = watch.seconds();
        assert!(wall >= 0.019 && cpu >= 0.019, "{wall} {cpu}");
        let before = thread_cpu();
        std::thread::sleep(Duration::from_millis(20));
        assert!(thread_cpu() - before < Duration::from_millis(10));
    }
}
