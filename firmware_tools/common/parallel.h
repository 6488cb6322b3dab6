// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>

namespace viewfix {

// Called from one thread at a time with how much of a stage is done.
using Progress = std::function<void(int done, int total)>;

// Runs body(i) for i in [0, count) on `jobs` threads (0: one for each core), in no
// particular order. The first exception ends the loop and is thrown again here.
// `progress` may be empty; what it throws ends the loop too.
void ParallelFor(int count, int jobs, const std::function<void(int)>& body,
                 const Progress& progress = {});

// The same where the body keeps scratch memory: body(i, worker), worker in [0, Workers(jobs)).
void ParallelForWorkers(int count, int jobs, const std::function<void(int, int)>& body,
                        const Progress& progress = {});
int Workers(int jobs);

}  // namespace viewfix
