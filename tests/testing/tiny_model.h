// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "models/model_writer.h"

namespace viewfix {

// A model that says something of any textured image and means nothing: random words and
// weights, features of this build. Locations "floor1/caf\u00e9" and "floor1/lobby", each with
// views "left" and "right"; eight keyframes, two a pair, the first of each with a pose. Its
// confidence threshold is 0: an image with features is always localized.
ModelData TinyModelData();

// The same as a file's bytes; ends the test program if the writer refuses.
std::vector<std::uint8_t> TinyModel();

// Adds landmarks to TinyModelData(): two maps, the second not metric, of 20 landmarks and two
// keyframes that see most of them.
void AddTinyMaps(ModelData& data);

// Adds a plan of 20 x 10 pixels; no more of its picture than the beginning of a PNG.
void AddTinyFloorPlan(ModelData& data);

// Adds random details, three for each list: one of either location and a common one.
void AddTinyDetails(ModelData& data);

// The tiny model with words of features that have colours, all of them grey.
ModelData ColourModelData();

// The rotation of details that leaves descriptors as they are.
std::vector<std::int8_t> NoRotation(int dim);

}  // namespace viewfix
