// SPDX-License-Identifier: BSD-3-Clause
#include "platform/publish/jpeg_encoder.h"

#include <csetjmp>
#include <cstddef>
#include <cstdio>
#include <cstdlib>

// Last: jpeglib.h uses size_t and FILE without including them.
#include <jpeglib.h>

namespace viewfix {
namespace {

// libjpeg leaves by longjmp, which must not cross an object with a destructor: Compress() holds
// none.
struct Encoder {
  jpeg_compress_struct info = {};
  jpeg_error_mgr errors = {};
  std::jmp_buf leave;
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
};

void OnError(j_common_ptr info) {
  std::longjmp(static_cast<Encoder*>(info->client_data)->leave, 1);
}
void OnMessage(j_common_ptr, int) {}

bool Compress(Encoder& encoder, const std::uint8_t* pixels, int width, int height, int quality) {
  jpeg_compress_struct& info = encoder.info;
  info.err = jpeg_std_error(&encoder.errors);
  encoder.errors.error_exit = OnError;
  encoder.errors.emit_message = OnMessage;
  info.client_data = &encoder;
  if (setjmp(encoder.leave) != 0) return false;
  jpeg_create_compress(&info);
  jpeg_mem_dest(&info, &encoder.bytes, &encoder.size);
  info.image_width = static_cast<JDIMENSION>(width);
  info.image_height = static_cast<JDIMENSION>(height);
  info.input_components = 3;
  info.in_color_space = JCS_RGB;
  jpeg_set_defaults(&info);
  jpeg_set_quality(&info, quality, TRUE);
  jpeg_start_compress(&info, TRUE);
  while (info.next_scanline < info.image_height) {
    JSAMPROW row =
        const_cast<JSAMPROW>(pixels + 3 * std::size_t{info.next_scanline} * info.image_width);
    jpeg_write_scanlines(&info, &row, 1);
  }
  jpeg_finish_compress(&info);
  return true;
}

}  // namespace

std::vector<std::uint8_t> EncodeJpeg(const RgbImage& image, int quality) {
  Encoder encoder;
  const bool ok = Compress(encoder, image.pixels.data(), image.width, image.height, quality);
  jpeg_destroy_compress(&encoder.info);
  std::vector<std::uint8_t> bytes;
  if (ok) bytes.assign(encoder.bytes, encoder.bytes + encoder.size);
  std::free(encoder.bytes);
  return bytes;
}

}  // namespace viewfix
