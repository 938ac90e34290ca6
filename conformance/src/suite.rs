//! Cases on devices, several at a time.

use std::num::NonZero;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;

use crate::{Case, Sidecar, Subject};

/// Cases at a time: half as many again as there are cores, since some wait for a driver that compiles one kernel after the other.
pub(crate) fn threads() -> usize {
    let cores = thread::available_parallelism().map_or(1, NonZero::get);
    cores + cores.div_ceil(2)
}

/// Tries every case on its device, half as many again at a time as the machine has cores, and tells `done` of each result as it
/// comes. Results are in the order of the work.
///
/// # Errors
/// The first of `done`; what is being tried then is finished and nothing more is begun.
pub fn try_all<E: Send>(
    work: &[(Subject, Case)],
    done: impl FnMut(&Sidecar) -> Result<(), E> + Send,
) -> Result<Vec<Sidecar>, E> {
    let next = AtomicUsize::new(0);
    let results: Mutex<(_, Vec<Option<Sidecar>>, Option<E>)> = Mutex::new((done, vec![None; work.len()], None));
    let worker = || {
        while let Some((i, (subject, case))) =
            Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|i| Some((i, work.get(i)?)))
        {
            let result = case.run(subject);
            let mut results = results.lock().unwrap_or_else(PoisonError::into_inner);
            let (done, all, error) = &mut *results;
            if error.is_some() {
                break;
            }
            if let Err(e) = done(&result) {
                *error = Some(e);
                break;
            }
            all[i] = Some(result);
        }
    };
    thread::scope(|scope| (0..threads().min(work.len())).for_each(|_| drop(scope.spawn(worker))));
    let (_, all, error) = results.into_inner().unwrap_or_else(PoisonError::into_inner);
    match error {
        Some(e) => Err(e),
        None => Ok(all.into_iter().flatten().collect()),
    }
}
