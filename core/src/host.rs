//! How much memory the machine has, and how much of it this process may still take.

use std::fs;
use std::path::Path;

/// Bytes of physical memory, where the system says.
pub fn memory() -> Option<u64> {
    meminfo("MemTotal:")
}

/// Bytes that this process could still take, where the system says: what the machine has available, what its control
/// groups leave, and what its own limit of address space does.
pub fn free_memory() -> Option<u64> {
    [meminfo("MemAvailable:"), group(), address_space()].into_iter().flatten().min()
}

fn meminfo(name: &str) -> Option<u64> {
    kibibytes(&fs::read_to_string("/proc/meminfo").ok()?, name)
}

/// The value of a line `name 123 kB`.
fn kibibytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    let kib: u64 = line.split_whitespace().next()?.parse().ok()?;
    kib.checked_mul(1024)
}

/// What the control groups of this process leave, each with those it lies in. A container sees its own as the root.
fn group() -> Option<u64> {
    let groups = fs::read_to_string("/proc/self/cgroup").ok()?;
    let version_2 = groups.lines().filter_map(|line| line.strip_prefix("0::")).map(|path| {
        let folder = Path::new("/sys/fs/cgroup").join(path.trim_start_matches('/'));
        (folder, ["memory.max", "memory.current"], "inactive_file ")
    });
    let version_1 = groups.lines().filter_map(|line| {
        let (controllers, path) = line.split_once(':')?.1.split_once(':')?;
        let folder = Path::new("/sys/fs/cgroup/memory").join(path.trim_start_matches('/'));
        let files = ["memory.limit_in_bytes", "memory.usage_in_bytes"];
        controllers.split(',').any(|c| c == "memory").then_some((folder, files, "total_inactive_file "))
    });
    version_2
        .chain(version_1)
        .flat_map(|(folder, files, cache)| {
            let up = folder.ancestors().take_while(|at| at.starts_with("/sys/fs/cgroup"));
            up.filter_map(|at| left(at, files, cache)).collect::<Vec<_>>()
        })
        .min()
}

/// What one control group leaves. Cached files that are not in use give way.
fn left(folder: &Path, [limit, usage]: [&str; 2], cache: &str) -> Option<u64> {
    let number = |name: &str| fs::read_to_string(folder.join(name)).ok()?.trim().parse::<u64>().ok();
    let statistics = fs::read_to_string(folder.join("memory.stat")).unwrap_or_default();
    let cached = statistics.lines().find_map(|line| line.strip_prefix(cache)?.parse::<u64>().ok()).unwrap_or(0);
    // A group without a limit says `max`, which is no number.
    Some(number(limit)?.saturating_sub(number(usage)?.saturating_sub(cached)))
}

/// What the limit of address space (`ulimit -v`) leaves.
fn address_space() -> Option<u64> {
    let limits = fs::read_to_string("/proc/self/limits").ok()?;
    let line = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    let limit: u64 = line.split_whitespace().next()?.parse().ok()?;
    let taken = kibibytes(&fs::read_to_string("/proc/self/status").ok()?, "VmSize:")?;
    Some(limit.saturating_sub(taken))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_group_leaves_its_limit_less_what_is_in_use() {
        let folder = std::env::temp_dir().join(format!("airlight-group-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let write = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
        let of = || left(&folder, ["memory.max", "memory.current"], "inactive_file ");
        assert_eq!(of(), None);
        write("memory.max", "max\n");
        write("memory.current", "700\n");
        assert_eq!(of(), None);
        write("memory.max", "1000\n");
        assert_eq!(of(), Some(300));
        write("memory.stat", "anon 400\ninactive_file 200\n");
        assert_eq!(of(), Some(500));
        write("memory.current", "1300\n");
        assert_eq!(of(), Some(0));
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn lines_are_found_by_their_whole_name() {
        let text = "MemTotalish: 1 kB\nMemTotal:       24683820 kB\n";
        assert_eq!(kibibytes(text, "MemTotal:"), Some(24683820 * 1024));
        assert_eq!(kibibytes(text, "SwapTotal:"), None);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn this_machine_has_memory() {
        assert!(free_memory().unwrap() > 0);
        assert!(memory().unwrap() >= meminfo("MemAvailable:").unwrap());
    }
}
