// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/jpeg_decoder.h"

#include <algorithm>
#include <csetjmp>
#include <cstddef>
#include <cstdio>
#include <string_view>
#include <vector>

// Last: jpeglib.h uses size_t and FILE without including them.
// clang-format off
#include <jpeglib.h>
#include <jerror.h>
// clang-format on

#include "platform/camera/exif.h"
#include "platform/camera/orient.h"

namespace viewfix {
namespace {

// A progressive picture needs about ten scans; a hostile one can hold thousands, each of
// which costs a pass over all its blocks.
constexpr int kMaxScans = 100;

constexpr std::string_view kExifMark{"Exif\0\0", 6};

StatusCode CodeOf(int jpeg_message) {
  switch (jpeg_message) {
    case JERR_ARITH_NOTIMPL:
    case JERR_BAD_PRECISION:
    case JERR_CCIR601_NOTIMPL:
    case JERR_CONVERSION_NOTIMPL:
    case JERR_FRACT_SAMPLE_NOTIMPL:
    case JERR_IMAGE_TOO_BIG:
    case JERR_NOT_COMPILED:
    case JERR_SOF_UNSUPPORTED:
    case JERR_WIDTH_OVERFLOW:
      return StatusCode::kUnsupported;
    case JERR_OUT_OF_MEMORY:
      return StatusCode::kResourceExhausted;
    default:
      return StatusCode::kCorrupt;
  }
}

// libjpeg-turbo with its error exits turned into a Status. libjpeg leaves by longjmp, which
// must not cross an object with a destructor: only the Guarded() functions call libjpeg, and
// they hold none.
class Decoder {
 public:
  // `lenient`: bytes between two markers, which many a webcam leaves there, are no damage.
  explicit Decoder(bool lenient = false) : lenient_(lenient) {
    info_.err = jpeg_std_error(&errors_);
    errors_.error_exit = OnError;
    errors_.emit_message = OnMessage;
    progress_.progress_monitor = OnProgress;
    info_.client_data = this;
  }
  ~Decoder() { jpeg_destroy_decompress(&info_); }
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;

  Status ReadHeader(std::span<const std::uint8_t> bytes) {
    if (!GuardedReadHeader(bytes)) return Failure();
    if (info_.num_components != 1 && info_.num_components != 3) {
      return {StatusCode::kUnsupported, "JPEG colours are neither grey, YCbCr nor RGB"};
    }
    const std::int64_t pixels = std::int64_t{info_.image_width} * info_.image_height;
    if (std::max(info_.image_width, info_.image_height) > unsigned{kMaxImageSide} ||
        pixels > kMaxImagePixels) {
      return {StatusCode::kUnsupported, "image is too large"};
    }
    return {};
  }

  // `enough_side`: as of DecodeJpegReduced; 0: whole.
  Status ReadPixels(int enough_side, YuvImage& image) {
    Reduce(enough_side);
    image.width = static_cast<int>(info_.output_width);
    image.height = static_cast<int>(info_.output_height);
    image.pixels.resize(std::size_t{info_.output_width} * info_.output_height);
    image.ClearChroma();
    if (image.luma_only || info_.jpeg_color_space != JCS_YCbCr) {
      return GuardedReadGrey(image.pixels.data()) ? Status() : Failure();
    }
    image.ResizeChroma();
    colour_rows_.resize(2 * 3 * std::size_t{info_.output_width});
    return GuardedReadColour(image) ? Status() : Failure();
  }

  ExifInfo exif() const {
    for (const jpeg_marker_struct* m = info_.marker_list; m != nullptr; m = m->next) {
      const std::span<const std::uint8_t> segment(m->data, m->data_length);
      if (segment.size() > kExifMark.size() &&
          std::equal(kExifMark.begin(), kExifMark.end(), segment.begin())) {
        return ParseExif(segment);
      }
    }
    return {};
  }

 private:
  void Reduce(int enough_side) {
    const int side = static_cast<int>(std::max(info_.image_width, info_.image_height));
    unsigned shrink = 1;
    while (enough_side > 0 && shrink < 8 && side / static_cast<int>(2 * shrink) >= enough_side) {
      shrink *= 2;
    }
    info_.scale_num = 1;
    info_.scale_denom = shrink;
    // As libjpeg rounds, which says it only once it has begun.
    info_.output_width = (info_.image_width + shrink - 1) / shrink;
    info_.output_height = (info_.image_height + shrink - 1) / shrink;
  }

  bool GuardedReadHeader(std::span<const std::uint8_t> bytes) {
    if (setjmp(leave_) != 0) return false;
    jpeg_create_decompress(&info_);
    info_.progress = &progress_;
    jpeg_save_markers(&info_, JPEG_APP0 + 1, 0xFFFF);
    jpeg_mem_src(&info_, bytes.data(), bytes.size());
    jpeg_read_header(&info_, TRUE);
    return true;
  }

  bool GuardedReadGrey(std::uint8_t* pixels) {
    if (setjmp(leave_) != 0) return false;
    info_.out_color_space = JCS_GRAYSCALE;
    Start();
    while (info_.output_scanline < info_.output_height) {
      JSAMPROW row = pixels + std::size_t{info_.output_scanline} * info_.output_width;
      jpeg_read_scanlines(&info_, &row, 1);
    }
    jpeg_finish_decompress(&info_);  // reads to the end: a missing end marker shows here
    return true;
  }

  // The same luma, to the bit.
  bool GuardedReadColour(YuvImage& image) {
    if (setjmp(leave_) != 0) return false;
    info_.out_color_space = JCS_YCbCr;
    info_.do_fancy_upsampling = FALSE;  // chroma is brought back to its own size below
    Start();
    while (info_.output_scanline < info_.output_height) {
      const unsigned y = info_.output_scanline;
      JSAMPROW row = colour_rows_.data() + y % 2 * 3 * std::size_t{info_.output_width};
      jpeg_read_scanlines(&info_, &row, 1);
      std::uint8_t* luma = image.pixels.data() + std::size_t{y} * info_.output_width;
      for (unsigned x = 0; x < info_.output_width; ++x) luma[x] = row[3 * x];
      if (y % 2 == 1 || y + 1 == info_.output_height) HalveChroma(y / 2, y % 2 == 1, image);
    }
    jpeg_finish_decompress(&info_);
    return true;
  }

  void Start() {
    info_.dct_method = JDCT_ISLOW;  // the one that all processors compute alike
    info_.do_block_smoothing = FALSE;
    jpeg_start_decompress(&info_);
  }

  // Row y of the chroma: means of squares of four, of two at an odd edge.
  void HalveChroma(unsigned y, bool two_rows, YuvImage& image) const {
    const int width = image.width;
    const std::uint8_t* upper = colour_rows_.data();
    const std::uint8_t* lower = two_rows ? upper + std::size_t{3} * width : upper;
    const std::size_t begin = std::size_t{y} * image.ChromaWidth();
    for (int x = 0; x < image.ChromaWidth(); ++x) {
      const int left = 6 * x, right = 2 * x + 1 < width ? left + 3 : left;
      const auto mean = [&](int c) {
        return static_cast<std::uint8_t>(
            (upper[left + c] + upper[right + c] + lower[left + c] + lower[right + c] + 2) / 4);
      };
      image.cb[begin + x] = mean(1);
      image.cr[begin + x] = mean(2);
    }
  }

  Status Failure() {
    if (too_many_scans_) return {StatusCode::kUnsupported, "JPEG has too many scans"};
    char message[JMSG_LENGTH_MAX];
    errors_.format_message(reinterpret_cast<j_common_ptr>(&info_), message);
    const StatusCode code = CodeOf(errors_.msg_code);
    const bool no_jpeg = errors_.msg_code == JERR_NO_SOI || errors_.msg_code == JERR_INPUT_EMPTY;
    const char* text = no_jpeg                            ? "not a JPEG"
                       : code == StatusCode::kUnsupported ? "unsupported JPEG"
                       : code == StatusCode::kCorrupt     ? "damaged JPEG"
                                                          : "JPEG not decoded";
    return {code, text, message};
  }

  static void OnError(j_common_ptr info) {
    std::longjmp(static_cast<Decoder*>(info->client_data)->leave_, 1);
  }

  // libjpeg fills what is missing with grey and only warns. An odd JFIF version or Adobe
  // block does not touch the pixels.
  static void OnMessage(j_common_ptr info, int level) {
    const int code = info->err->msg_code;
    if (level >= 0 || code == JWRN_JFIF_MAJOR || code == JWRN_ADOBE_XFORM) return;
    if (code == JWRN_EXTRANEOUS_DATA && static_cast<Decoder*>(info->client_data)->lenient_) return;
    OnError(info);
  }

  static void OnProgress(j_common_ptr info) {
    if (reinterpret_cast<j_decompress_ptr>(info)->input_scan_number <= kMaxScans) return;
    static_cast<Decoder*>(info->client_data)->too_many_scans_ = true;
    OnError(info);
  }

  jpeg_decompress_struct info_ = {};
  jpeg_error_mgr errors_ = {};
  jpeg_progress_mgr progress_ = {};
  std::vector<std::uint8_t> colour_rows_;  // two, of three bytes a pixel
  const bool lenient_;
  bool too_many_scans_ = false;
  std::jmp_buf leave_;
};

}  // namespace

Status DecodeJpeg(std::span<const std::uint8_t> bytes, YuvImage& image, ExifInfo* exif) {
  image.width = image.height = 0;
  Decoder decoder;
  if (Status status = decoder.ReadHeader(bytes); !status.ok()) return status;
  const ExifInfo found = decoder.exif();
  YuvImage stored;
  stored.luma_only = image.luma_only;
  YuvImage& pixels = found.orientation == 1 ? image : stored;
  if (Status status = decoder.ReadPixels(0, pixels); !status.ok()) {
    image.width = image.height = 0;
    return status;
  }
  if (found.orientation != 1) Orient(stored, found.orientation, image);
  if (exif != nullptr) *exif = found;
  return {};
}

Status DecodeJpegReduced(std::span<const std::uint8_t> bytes, int enough_side, YuvImage& image) {
  image.width = image.height = 0;
  Decoder decoder(/*lenient=*/true);
  Status status = decoder.ReadHeader(bytes);
  if (status.ok()) status = decoder.ReadPixels(enough_side, image);
  if (!status.ok()) image.width = image.height = 0;
  return status;
}

}  // namespace viewfix
