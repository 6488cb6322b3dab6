// SPDX-License-Identifier: BSD-3-Clause
#include "models/model_view.h"

#include <sodium.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <numeric>

#include "models/huffman_decoder.h"
#include "models/viewfix_generated.h"

// FlatBuffers stores little endian; the spans handed out are used as they lie.
static_assert(std::endian::native == std::endian::little);

namespace viewfix {
namespace {

Status Corrupt(const char* text) { return {StatusCode::kCorrupt, text}; }

template <typename T>
T ReadLittleEndian(const std::uint8_t* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

template <typename T>
std::span<const T> Span(const flatbuffers::Vector<T>* vector) {
  // The verifier lets a vector of doubles begin at any multiple of four: taken for none then, which
  // no check of sizes lets pass.
  if (vector == nullptr || reinterpret_cast<std::uintptr_t>(vector->data()) % alignof(T) != 0) {
    return {};
  }
  return {vector->data(), vector->size()};
}

std::span<const std::uint8_t> TablesOf(const fb::EncodedRows* encoded) {
  return encoded == nullptr ? std::span<const std::uint8_t>() : Span(encoded->tables());
}

std::size_t BytesOf(const fb::EncodedRows* encoded) {
  return encoded == nullptr ? 0 : Span(encoded->tables()).size() + Span(encoded->rows()).size();
}

std::optional<HuffmanDecoder> DecoderOf(const fb::EncodedRows* encoded) {
  if (encoded == nullptr) return std::nullopt;
  return HuffmanDecoder::Open(Span(encoded->tables()), Span(encoded->rows()));
}

// Takes room for what so many bytes of rows become. False: there is no such room, or they cannot be
// in there, where a code has a bit at least.
bool TakeRoom(const fb::EncodedRows* encoded, std::uint64_t bytes, std::size_t decoded_size,
              std::uint64_t& room) {
  if (encoded == nullptr || bytes / 8 > Span(encoded->rows()).size()) return false;
  if (bytes > room / decoded_size) return false;
  room -= bytes * decoded_size;
  return true;
}

// All of the rows. False: there are others.
//   end_of  where a row ends among the bytes of all
template <typename T, typename EndOf>
bool DecodeRows(const fb::EncodedRows* encoded, std::size_t num_rows, const EndOf& end_of,
                std::uint64_t& room, std::vector<T>& bytes) {
  if (!TakeRoom(encoded, num_rows == 0 ? 0 : end_of(num_rows - 1), sizeof(T), room)) return false;
  std::optional<HuffmanDecoder> decoder = DecoderOf(encoded);
  if (!decoder) return false;
  bytes.resize(num_rows == 0 ? 0 : static_cast<std::size_t>(end_of(num_rows - 1)));
  auto byte = bytes.begin();
  for (std::size_t row = 0; row < num_rows; ++row) {
    decoder->StartRow();
    const auto end = bytes.begin() + static_cast<std::ptrdiff_t>(end_of(row));
    for (; byte < end; ++byte) *byte = static_cast<T>(decoder->Next());
  }
  return decoder->IsAtEnd();
}

// The same of rows of one length.
template <typename T>
bool DecodeTable(const fb::EncodedRows* encoded, std::size_t num_rows, std::size_t length,
                 std::uint64_t& room, std::vector<T>& bytes) {
  const auto end_of = [length](std::uint64_t row) { return (row + 1) * length; };
  return DecodeRows(encoded, num_rows, end_of, room, bytes);
}

template <typename T>
bool AllFinite(std::span<const T> values) {
  return std::all_of(values.begin(), values.end(), [](T v) { return std::isfinite(v); });
}

const fb::Model* Root(std::span<const std::uint8_t> file) {
  return fb::GetModel(file.data() + kModelHeaderBytes);
}

using Names = flatbuffers::Vector<flatbuffers::Offset<flatbuffers::String>>;

std::string_view NameAt(const Names* names, int i) {
  const auto* name = names->Get(static_cast<flatbuffers::uoffset_t>(i));
  return {name->c_str(), name->size()};
}

bool ValidName(std::string_view name) {
  return !name.empty() && name.size() <= 255 && name.front() != '/' && name.back() != '/' &&
         name.find('\0') == std::string_view::npos;
}

// Names are few hundred at most on a site; a site of ten thousand locations still takes
// only a sorted copy's time, but no memory is taken for that: order is demanded instead.
Status CheckNames(const Names* names, const char* what) {
  if (names == nullptr || names->size() == 0) return Corrupt(what);
  for (int i = 0; i < static_cast<int>(names->size()); ++i) {
    if (!ValidName(NameAt(names, i))) return Corrupt(what);
    if (i > 0 && !(NameAt(names, i - 1) < NameAt(names, i))) return Corrupt(what);
  }
  return {};
}

Status CheckHeader(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < kModelHeaderBytes) return Corrupt("not a model: shorter than its header");
  if (!std::equal(kModelMagic.begin(), kModelMagic.end(), bytes.begin())) {
    return Corrupt("not a Viewfix model (wrong magic)");
  }
  if (reinterpret_cast<std::uintptr_t>(bytes.data()) % 8 != 0) {
    return {StatusCode::kInvalidArgument, "model bytes must be aligned to 8"};
  }
  const auto version = ReadLittleEndian<std::uint32_t>(&bytes[8]);
  if (version > kModelFormatVersion) {
    return {StatusCode::kUnsupported, "model format is newer than this program; update it"};
  }
  if (version != kModelFormatVersion) {
    return {StatusCode::kUnsupported, "model format is older than this program; train it again"};
  }
  if (ReadLittleEndian<std::uint32_t>(&bytes[12]) != kModelHeaderBytes) {
    return Corrupt("model header length is wrong");
  }
  const auto payload = ReadLittleEndian<std::uint64_t>(&bytes[16]);
  if (payload > bytes.size() - kModelHeaderBytes) return Corrupt("model is truncated");
  if (payload < bytes.size() - kModelHeaderBytes) return Corrupt("model has bytes after its end");
  return {};
}

Status CheckHash(std::span<const std::uint8_t> bytes) {
  const auto hash = HashModel(bytes);
  if (!std::equal(hash.begin(), hash.end(), bytes.begin() + kModelHashOffset)) {
    return Corrupt("model is damaged (hash does not match)");
  }
  return {};
}

bool ValidPose(std::span<const float> pose) {
  const float norm2 = pose[3] * pose[3] + pose[4] * pose[4] + pose[5] * pose[5] + pose[6] * pose[6];
  return AllFinite(pose) && norm2 > 0.99F && norm2 < 1.01F;
}

}  // namespace

std::array<std::uint8_t, kModelHashBytes> HashModel(std::span<const std::uint8_t> file) {
  std::array<std::uint8_t, kModelHashBytes> hash;
  crypto_generichash_state state;
  crypto_generichash_init(&state, nullptr, 0, hash.size());
  crypto_generichash_update(&state, file.data(), kModelHashOffset);
  const auto payload = file.subspan(kModelHeaderBytes);
  crypto_generichash_update(&state, payload.data(), payload.size());
  crypto_generichash_final(&state, hash.data(), hash.size());
  return hash;
}

bool IsFloorPlanPicture(std::span<const std::uint8_t> file) {
  constexpr std::array<std::uint8_t, 8> kPng = {0x89, 'P', 'N', 'G', 0x0D, 0x0A, 0x1A, 0x0A};
  constexpr std::array<std::uint8_t, 3> kJpeg = {0xFF, 0xD8, 0xFF};
  const auto begins_with = [&](std::span<const std::uint8_t> magic) {
    return file.size() > magic.size() && std::equal(magic.begin(), magic.end(), file.begin());
  };
  return begins_with(kPng) || begins_with(kJpeg);
}

Result<ModelView> ModelView::Open(std::span<const std::uint8_t> bytes) {
  if (Status status = CheckHeader(bytes); !status.ok()) return status;
  if (Status status = CheckHash(bytes); !status.ok()) return status;
  const auto payload = bytes.subspan(kModelHeaderBytes);
  flatbuffers::Verifier verifier(payload.data(), payload.size());
  if (!fb::VerifyModelBuffer(verifier)) return Corrupt("model structure is broken");
  ModelView view;
  view.bytes_ = bytes;
  view.decoded_ = std::make_shared<Decoded>();
  if (Status status = view.Load(); !status.ok()) return status;
  return view;
}

Status ModelView::Load() {
  using Loader = Status (ModelView::*)();
  for (const Loader load :
       {&ModelView::LoadFeatures, &ModelView::LoadVocabulary, &ModelView::LoadScoring,
        &ModelView::LoadConfidence, &ModelView::LoadKeyframes, &ModelView::LoadKeyframePoses,
        &ModelView::LoadKeyframeNames, &ModelView::LoadCamera, &ModelView::LoadLandmarks,
        &ModelView::LoadKeyframeLandmarks, &ModelView::LoadFloorPlan, &ModelView::LoadDetails,
        &ModelView::LoadGolden, &ModelView::LoadPoseConfidence}) {
    if (Status status = (this->*load)(); !status.ok()) return status;
  }
  metric_ = Root(bytes_)->metric();
  const auto* record = Root(bytes_)->record();
  record_ = {record->c_str(), record->size()};
  return {};
}

Status ModelView::LoadFeatures() {
  const fb::Features* f = Root(bytes_)->features();
  features_ = {f->type(),    f->version(),   f->max_image_side(), f->max_features(),
               f->upright(), f->threshold(), f->descriptor_dim()};
  const bool valid = features_.max_image_side >= 64 && features_.max_image_side <= 4096 &&
                     features_.max_features >= 16 && features_.max_features <= 8192 &&
                     std::isfinite(features_.threshold) && features_.threshold >= 0 &&
                     features_.descriptor_dim >= 1 && features_.descriptor_dim <= 128;
  if (!valid) return Corrupt("model's feature options are out of range");
  if (!Span(f->projection()).empty()) {
    return {StatusCode::kUnsupported, "model projects descriptors, which this program cannot"};
  }
  return {};
}

Status ModelView::LoadVocabulary() {
  const fb::Vocabulary* v = Root(bytes_)->vocabulary();
  const std::uint32_t num_words = v->num_words();
  if (num_words < 1 || num_words > 65535) return Corrupt("model's number of words is out of range");
  if (v->dim() != features_.descriptor_dim) return Corrupt("model's words have a wrong dimension");
  if (!DecodeTable(v->words(), num_words, v->dim(), decoded_->room, decoded_->words)) {
    return Corrupt("model's vocabulary has a wrong size");
  }
  vocabulary_ = {static_cast<int>(num_words), v->dim(), decoded_->words, v->words_per_feature()};
  const int votes = vocabulary_.words_per_feature;
  if (votes < 1 || votes > kMaxWordsPerFeature || votes > vocabulary_.num_words) {
    return Corrupt("model's number of words for a feature is out of range");
  }
  return {};
}

Status ModelView::LoadScoring() {
  const fb::Scoring* s = Root(bytes_)->scoring();
  if (Status st = CheckNames(s->locations(), "model's location names are broken"); !st.ok()) {
    return st;
  }
  if (Status st = CheckNames(s->views(), "model's view names are broken"); !st.ok()) return st;
  scoring_ = {static_cast<HistogramMap>(s->histogram_map()),
              static_cast<LocationRule>(s->location_rule()),
              static_cast<int>(s->locations()->size()),
              static_cast<int>(s->views()->size()),
              static_cast<int>(Span(s->pair_location()).size()),
              Span(s->pair_location()),
              Span(s->pair_view()),
              Span(s->bias()),
              Span(s->weight_scale()),
              {},
              s->keyframe_weight()};
  const ModelScoring& g = scoring_;
  const std::size_t pairs = g.pair_location.size();
  const bool known = s->histogram_map() >= 1 && s->histogram_map() <= 2 &&
                     s->location_rule() >= 1 && s->location_rule() <= 2;
  if (!known) return Corrupt("model's scoring rule is unknown");
  const bool sizes = pairs >= 1 && pairs <= 65535 && g.pair_view.size() == pairs &&
                     g.bias.size() == pairs && g.weight_scale.size() == pairs &&
                     DecodeTable(s->weights(), vocabulary_.num_words, PackedWeights(g.num_pairs),
                                 decoded_->room, decoded_->weights);
  if (!sizes) return Corrupt("model's scoring tables have wrong sizes");
  scoring_.weights = decoded_->weights;
  if (!AllFinite(g.bias) || !AllFinite(g.weight_scale) || !std::isfinite(g.keyframe_weight)) {
    return Corrupt("model's scoring tables hold a number that is not finite");
  }
  if (g.keyframe_weight < 0) return Corrupt("model's keyframe weight is negative");
  int next_location = 0;  // pairs go through all locations in order, views ascending in each
  for (std::size_t p = 0; p < pairs; ++p) {
    const bool first = p == 0 || g.pair_location[p] != g.pair_location[p - 1];
    const bool in_order =
        first ? g.pair_location[p] == next_location++ : g.pair_view[p] > g.pair_view[p - 1];
    if (!in_order || g.pair_view[p] >= g.num_views) {
      return Corrupt("model's (location, view) pairs are broken");
    }
  }
  if (next_location != g.num_locations) return Corrupt("model has a location without a view");
  return {};
}

Status ModelView::LoadConfidence() {
  const fb::Confidence* c = Root(bytes_)->confidence();
  confidence_ = {c->offset(), c->slope(), c->threshold()};
  const bool valid = std::isfinite(c->offset()) && std::isfinite(c->slope()) && c->slope() >= 0 &&
                     c->threshold() >= 0 && c->threshold() <= 1;
  return valid ? Status() : Corrupt("model's confidence curve is out of range");
}

Status ModelView::LoadPoseConfidence() {
  const fb::PoseConfidence* c = Root(bytes_)->pose_confidence();
  if (c == nullptr) return {};
  const auto weights = Span(c->weights());
  const bool valid = std::isfinite(c->offset()) && weights.size() == kPoseCues &&
                     AllFinite(weights) && c->threshold() >= 0 && c->threshold() <= 1;
  if (!valid) return Corrupt("model's confidence in poses is out of range");
  pose_confidence_.emplace();
  pose_confidence_->offset = c->offset();
  std::copy(weights.begin(), weights.end(), pose_confidence_->weights.begin());
  pose_confidence_->threshold = c->threshold();
  return {};
}

namespace {

// A keyframe's entries end with a word, and none is beyond the vocabulary.
bool ValidWords(std::span<const std::uint8_t> entries, int num_words) {
  std::int64_t word = -1;
  for (const std::uint8_t entry : entries) word += StepOf(entry);
  return word < num_words && CountOf(entries.back()) > 0;
}

}  // namespace

Status ModelView::LoadKeyframes() {
  const fb::Keyframes* f = Root(bytes_)->keyframes();
  const std::size_t size = Span(f->pair()).size();
  keyframes_ = {static_cast<int>(size),    Span(f->pair()),
                Span(f->word_begin()),     {},
                Span(f->has_pose()),       {},
                Span(f->landmark_begin()), {}};
  const ModelKeyframes& k = keyframes_;
  if (k.word_begin.size() != size + 1 || k.has_pose.size() != size) {
    return Corrupt("model's keyframe tables have wrong sizes");
  }
  const auto end_of = [&](std::size_t row) { return k.word_begin[row + 1]; };
  if (k.word_begin.front() != 0 || !std::ranges::is_sorted(k.word_begin) ||
      !DecodeRows(f->words(), size, end_of, decoded_->room, decoded_->keyframe_words)) {
    return Corrupt("model's keyframe histograms are broken");
  }
  keyframes_.words = decoded_->keyframe_words;
  for (std::size_t i = 0; i < size; ++i) {
    const std::uint32_t begin = k.word_begin[i];
    const std::uint32_t end = k.word_begin[i + 1];
    const bool valid = k.pair[i] < scoring_.num_pairs && (i == 0 || k.pair[i] >= k.pair[i - 1]) &&
                       begin < end && k.has_pose[i] <= 1;
    if (!valid || !ValidWords(k.words.subspan(begin, end - begin), vocabulary_.num_words)) {
      return Corrupt("model's keyframe is broken");
    }
  }
  return {};
}

Status ModelView::LoadKeyframePoses() {
  const std::span<const float> poses = Span(Root(bytes_)->keyframes()->pose());
  std::vector<float>& decoded = decoded_->keyframe_pose;
  decoded.assign(std::size_t(keyframes_.size) * 7,
                 0.0F);  // four times what keyframes take at least
  std::size_t next = 0;
  for (int i = 0; i < keyframes_.size; ++i) {
    if (keyframes_.has_pose[i] == 0) continue;
    if (poses.size() - next < 7 || !ValidPose(poses.subspan(next, 7))) {
      return Corrupt("model's keyframe has a broken pose");
    }
    std::copy_n(&poses[next], 7, &decoded[std::size_t(i) * 7]);
    next += 7;
  }
  if (next != poses.size()) return Corrupt("model has a pose without a keyframe");
  keyframes_.pose = decoded;
  return {};
}

Status ModelView::LoadKeyframeNames() {
  const fb::EncodedRows* encoded = Root(bytes_)->keyframes()->names();
  if (encoded == nullptr) return {};
  const auto is_broken = [] { return Corrupt("model's keyframe names are broken"); };
  std::optional<HuffmanDecoder> decoder = DecoderOf(encoded);
  if (!decoder) return is_broken();
  std::string name;
  for (int i = 0; i < keyframes_.size; ++i) {
    decoder->StartRow();
    const std::size_t shared = decoder->Next();
    if (shared > name.size()) return is_broken();
    name.resize(shared);
    while (const std::uint8_t byte = decoder->Next()) {
      if (name.size() == kMaxKeyframeNameBytes) return is_broken();
      name.push_back(static_cast<char>(byte));
    }
    if (!TakeRoom(encoded, 1, sizeof name + name.size(), decoded_->room)) return is_broken();
    decoded_->keyframe_names.push_back(name);
  }
  return decoder->IsAtEnd() ? Status() : is_broken();
}

Status ModelView::LoadCamera() {
  const fb::Camera* c = Root(bytes_)->camera();
  if (c == nullptr) return {};
  camera_ = {c->model(), c->width(), c->height(), Span(c->intrinsics()), Span(c->distortion())};
  const bool valid = camera_.width >= 1 && camera_.height >= 1 && camera_.intrinsics.size() == 4 &&
                     camera_.distortion.size() == 8 && camera_.model >= 1 && camera_.model <= 3 &&
                     AllFinite(camera_.intrinsics) && AllFinite(camera_.distortion) &&
                     camera_.intrinsics[0] > 0 && camera_.intrinsics[1] > 0;
  return valid ? Status() : Corrupt("model's camera is out of range");
}

Status ModelView::LoadLandmarks() {
  const fb::Landmarks* l = Root(bytes_)->landmarks();
  if (l == nullptr) return {};
  const std::size_t size = Span(l->laplacian_sign()).size();
  const std::size_t maps = Span(l->map_step()).size();
  landmarks_ = {static_cast<int>(size),
                static_cast<int>(maps),
                Span(l->map_begin()),
                Span(l->map_origin()),
                Span(l->map_step()),
                Span(l->position()),
                {},
                Span(l->laplacian_sign()),
                Span(l->rarity()),
                l->pixel_sigma(),
                Span(l->map_metric()),
                {}};
  const ModelLandmarks& m = landmarks_;
  const bool sizes =
      size >= 1 && size <= kMaxLandmarks && maps >= 1 && maps <= 65535 &&
      m.map_begin.size() == maps + 1 && m.map_origin.size() == 3 * maps &&
      m.position.size() == 3 * size && m.rarity.size() == size && m.map_begin.front() == 0 &&
      m.map_begin.back() == size && (m.map_metric.empty() || m.map_metric.size() == maps) &&
      DecodeTable(l->descriptors(), size, features_.descriptor_dim, decoded_->room,
                  decoded_->landmark_descriptors) &&
      (l->chroma() == nullptr || DecodeTable(l->chroma(), size, kLandmarkChromaDim, decoded_->room,
                                             decoded_->landmark_chroma));
  if (!sizes || camera_.width == 0) return Corrupt("model's landmark tables have wrong sizes");
  landmarks_.descriptors = decoded_->landmark_descriptors;
  landmarks_.chroma = decoded_->landmark_chroma;
  if (!std::isfinite(m.pixel_sigma) || m.pixel_sigma <= 0 || !AllFinite(m.map_origin)) {
    return Corrupt("model's landmarks hold a number that is out of range");
  }
  const auto is_flag = [](std::uint8_t flag) { return flag <= 1; };
  if (!std::all_of(m.map_metric.begin(), m.map_metric.end(), is_flag)) {
    return Corrupt("model's map is neither metric nor not");
  }
  const auto is_sign = [](std::int8_t sign) { return sign >= -1 && sign <= 1; };
  if (!std::all_of(m.laplacian_sign.begin(), m.laplacian_sign.end(), is_sign)) {
    return Corrupt("model's landmark has no sign");
  }
  for (std::size_t i = 0; i < maps; ++i) {
    if (m.map_begin[i] > m.map_begin[i + 1] || !std::isfinite(m.map_step[i]) ||
        m.map_step[i] <= 0) {
      return Corrupt("model's map is broken");
    }
  }
  return {};
}

Status ModelView::LoadKeyframeLandmarks() {
  const ModelKeyframes& k = keyframes_;
  const fb::EncodedRows* encoded = Root(bytes_)->keyframes()->landmarks();
  if (landmarks_.size == 0) {
    return encoded == nullptr && k.landmark_begin.empty()
               ? Status()
               : Corrupt("model's keyframes see landmarks that it lacks");
  }
  const auto is_broken = [] { return Corrupt("model's keyframe landmarks are broken"); };
  std::optional<HuffmanDecoder> decoder = DecoderOf(encoded);
  if (!decoder || k.landmark_begin.size() != std::size_t(k.size) + 1 ||
      k.landmark_begin.front() != 0 || !std::ranges::is_sorted(k.landmark_begin) ||
      !TakeRoom(encoded, k.landmark_begin.back(), sizeof(std::uint32_t), decoded_->room)) {
    return is_broken();
  }
  std::vector<std::uint32_t>& landmarks = decoded_->keyframe_landmarks;
  landmarks.reserve(k.landmark_begin.back());
  for (int i = 0; i < k.size; ++i) {
    const std::uint32_t begin = k.landmark_begin[i];
    const std::uint32_t end = k.landmark_begin[i + 1];
    if (begin < end && k.has_pose[i] == 0) return is_broken();
    decoder->StartRow();
    std::int64_t landmark = -1;
    while (landmarks.size() < end) {
      std::uint8_t step = decoder->Next();
      for (; step == 255 && landmark < landmarks_.size; step = decoder->Next()) landmark += 255;
      landmark += step + 1;
      if (landmark >= landmarks_.size) return is_broken();
      landmarks.push_back(static_cast<std::uint32_t>(landmark));
    }
    if (begin < end && MapOf(landmarks[begin]) != MapOf(landmarks[end - 1])) {
      return Corrupt("model's keyframe sees landmarks of two maps");
    }
  }
  if (!decoder->IsAtEnd()) return is_broken();
  keyframes_.landmarks = landmarks;
  return {};
}

Status ModelView::LoadFloorPlan() {
  const fb::FloorPlan* f = Root(bytes_)->floor_plan();
  if (f == nullptr) return {};
  floor_plan_ = {Span(f->picture()), f->width(), f->height(), Span(f->site_from_pixel())};
  const ModelFloorPlan& p = floor_plan_;
  const bool valid = p.picture.size() <= kMaxFloorPlanBytes && IsFloorPlanPicture(p.picture) &&
                     p.width >= 1 && p.height >= 1 && p.site_from_pixel.size() == 4 &&
                     AllFinite(p.site_from_pixel) &&
                     (p.site_from_pixel[0] != 0 || p.site_from_pixel[1] != 0);
  return valid ? Status() : Corrupt("model's floor plan is out of range");
}

Status ModelView::LoadDetails() {
  const fb::Details* d = Root(bytes_)->details();
  if (d == nullptr) return {};
  std::vector<std::uint8_t>& list_size = decoded_->detail_lists;
  const std::size_t lists = 2 * std::size_t(vocabulary_.num_words);
  if (!DecodeTable(d->list_size(), std::size_t(scoring_.num_locations) + 1, lists, decoded_->room,
                   list_size)) {
    return Corrupt("model's lists of details are broken");
  }
  // As many as 32 bits do not hold, on a board that has no more.
  const std::uint64_t size = std::accumulate(list_size.begin(), list_size.end(), std::uint64_t{0});
  const std::size_t dim = features_.descriptor_dim;
  if (size < 1 || size > kMaxDetails) {
    return Corrupt("model's lists of details have wrong sizes");
  }
  details_ = {static_cast<int>(size), d->parts(),       Span(d->rotation()),
              Span(d->codebook()),    list_size,        Span(d->codes()),
              d->likeness_weight(),   d->close_weight()};
  const ModelDetails& m = details_;
  const std::size_t turned_dim = m.rotation.size() / dim;
  const bool tables = m.parts >= 1 && turned_dim >= 1 && turned_dim <= dim &&
                      m.rotation.size() == turned_dim * dim && turned_dim % m.parts == 0 &&
                      m.codebook.size() == kCodesOfPart * turned_dim &&
                      m.codes.size() == size * m.parts;
  if (!tables) return Corrupt("model's detail tables have wrong sizes");
  const auto is_weight = [](float weight) { return std::isfinite(weight) && weight >= 0; };
  if (!is_weight(m.likeness_weight)) return Corrupt("model's weight of likeness is out of range");
  if (!is_weight(m.close_weight)) return Corrupt("model's weight of close details is out of range");
  return {};
}

Status ModelView::LoadGolden() {
  const fb::GoldenQueries* q = Root(bytes_)->golden();
  if (q == nullptr) return {};
  const std::size_t size = Span(q->pair()).size();
  golden_ = {static_cast<int>(size),
             Span(q->width()),
             Span(q->height()),
             Span(q->begin()),
             Span(q->keypoints()),
             Span(q->laplacian_sign()),
             {},
             Span(q->pair()),
             Span(q->has_pose()),
             Span(q->pose())};
  const ModelGolden& g = golden_;
  const std::size_t features = g.laplacian_sign.size();
  const bool sizes =
      size >= 1 && size <= kMaxGoldenQueries && g.width.size() == size && g.height.size() == size &&
      g.begin.size() == size + 1 && g.begin.front() == 0 && g.begin.back() == features &&
      g.keypoints.size() == 5 * features && g.has_pose.size() == size &&
      g.pose.size() == 7 * size && features <= size * std::size_t(features_.max_features) &&
      DecodeTable(q->descriptors(), features, features_.descriptor_dim, decoded_->room,
                  decoded_->golden_descriptors);
  if (!sizes) return Corrupt("model's golden queries have wrong sizes");
  golden_.descriptors = decoded_->golden_descriptors;
  const auto is_sign = [](std::int8_t sign) { return sign >= -1 && sign <= 1; };
  if (!AllFinite(g.keypoints) ||
      !std::all_of(g.laplacian_sign.begin(), g.laplacian_sign.end(), is_sign)) {
    return Corrupt("model's golden query has a broken feature");
  }
  const int side = features_.max_image_side;
  for (std::size_t i = 0; i < size; ++i) {
    const bool valid = g.begin[i] <= g.begin[i + 1] && g.begin[i + 1] <= features &&
                       g.begin[i + 1] - g.begin[i] <= std::uint32_t(features_.max_features) &&
                       g.width[i] >= 1 && g.height[i] >= 1 && g.width[i] <= side &&
                       g.height[i] <= side && g.pair[i] < scoring_.num_pairs &&
                       g.has_pose[i] <= 1 &&
                       (g.has_pose[i] == 0 || ValidPose(g.pose.subspan(i * 7, 7)));
    if (!valid) return Corrupt("model's golden query is broken");
  }
  return {};
}

int ModelView::MapOf(std::uint32_t landmark_idx) const {
  const auto& begin = landmarks_.map_begin;
  const auto next = std::upper_bound(begin.begin(), begin.end(), landmark_idx);
  return static_cast<int>(next - begin.begin()) - 1;
}

std::string_view ModelView::location_name(int location_idx) const {
  return NameAt(Root(bytes_)->scoring()->locations(), location_idx);
}

std::string_view ModelView::view_name(int view_idx) const {
  return NameAt(Root(bytes_)->scoring()->views(), view_idx);
}

std::string_view ModelView::keyframe_name(int keyframe_idx) const {
  const std::vector<std::string>& names = decoded_->keyframe_names;
  return names.empty() ? std::string_view() : names[keyframe_idx];
}

ModelSections ModelView::sections() const {
  const fb::Model* m = Root(bytes_);
  const fb::Keyframes* k = m->keyframes();
  ModelSections sections = {
      .vocabulary = BytesOf(m->vocabulary()->words()),
      .weights = BytesOf(m->scoring()->weights()),
      .keyframe_histograms = keyframes_.word_begin.size_bytes() + BytesOf(k->words()),
      .keyframe_poses = Span(k->pose()).size_bytes() + keyframes_.has_pose.size_bytes(),
      .keyframe_landmarks = keyframes_.landmark_begin.size_bytes() + BytesOf(k->landmarks()),
      .keyframe_names = BytesOf(k->names()),
      .floor_plan = floor_plan_.picture.size(),
      .record = record_.size()};
  if (const fb::Landmarks* l = m->landmarks(); l != nullptr) {
    sections.landmark_positions = landmarks_.position.size_bytes();
    sections.landmark_descriptors = BytesOf(l->descriptors()) +
                                    landmarks_.laplacian_sign.size_bytes() +
                                    landmarks_.rarity.size_bytes();
    sections.landmark_chroma = l->chroma() == nullptr ? 0 : BytesOf(l->chroma());
  }
  if (const fb::Details* d = m->details(); d != nullptr) {
    sections.details = details_.rotation.size_bytes() + details_.codebook.size_bytes() +
                       BytesOf(d->list_size()) + details_.codes.size_bytes();
  }
  if (const fb::GoldenQueries* g = m->golden(); g != nullptr) {
    sections.golden_queries = golden_.keypoints.size_bytes() + BytesOf(g->descriptors()) +
                              golden_.laplacian_sign.size_bytes();
  }
  return sections;
}

ModelCodeTables ModelView::code_tables() const {
  const fb::Model* m = Root(bytes_);
  const fb::Keyframes* k = m->keyframes();
  return {
      .words = TablesOf(m->vocabulary()->words()),
      .weights = TablesOf(m->scoring()->weights()),
      .keyframe_words = TablesOf(k->words()),
      .keyframe_landmarks = TablesOf(k->landmarks()),
      .keyframe_names = TablesOf(k->names()),
      .landmark_descriptors =
          TablesOf(m->landmarks() == nullptr ? nullptr : m->landmarks()->descriptors()),
      .landmark_chroma = TablesOf(m->landmarks() == nullptr ? nullptr : m->landmarks()->chroma()),
      .detail_lists = TablesOf(m->details() == nullptr ? nullptr : m->details()->list_size()),
      .golden_descriptors =
          TablesOf(m->golden() == nullptr ? nullptr : m->golden()->descriptors())};
}

std::array<char, 16> ModelView::short_hash() const {
  std::array<char, 16> text;
  for (int i = 0; i < 16; ++i) {
    const int nibble = (hash()[i / 2] >> (i % 2 == 0 ? 4 : 0)) & 15;
    text[i] = "0123456789abcdef"[nibble];
  }
  return text;
}

}  // namespace viewfix
