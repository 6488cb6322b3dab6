// SPDX-License-Identifier: BSD-3-Clause
#include "firmware_tools/common/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace viewfix {

int Workers(int jobs) {
  return jobs > 0 ? jobs : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

void ParallelForWorkers(int count, int jobs, const std::function<void(int, int)>& body,
                        const Progress& progress) {
  std::atomic<int> next = 0;
  std::mutex mutex;  // guards done, error and calls of progress
  int done = 0;
  std::exception_ptr error;
  const auto work = [&](int worker) {
    for (int i = next++; i < count; i = next++) {
      try {
        body(i, worker);
        const std::lock_guard lock(mutex);
        if (progress && !error) progress(++done, count);
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (!error) error = std::current_exception();
        next = count;
      }
    }
  };
  std::vector<std::thread> threads;
  for (int w = 1; w < std::min(Workers(jobs), count); ++w) threads.emplace_back(work, w);
  work(0);
  for (std::thread& thread : threads) thread.join();
  if (error) std::rethrow_exception(error);
}

void ParallelFor(int count, int jobs, const std::function<void(int)>& body,
                 const Progress& progress) {
  ParallelForWorkers(count, jobs, [&](int i, int) { body(i); }, progress);
}

}  // namespace viewfix
