// SPDX-License-Identifier: BSD-3-Clause
#include "platform/camera/exif.h"

#include <libexif/exif-data.h>

#include <memory>

namespace viewfix {
namespace {

struct ExifDataDeleter {
  void operator()(ExifData* data) const { exif_data_unref(data); }
};

// The tag's first number; 0 where it is absent or no SHORT (both tags are SHORT by Exif 2.32).
int ShortOf(ExifData& data, ExifIfd ifd, ExifTag tag) {
  const ExifEntry* entry = exif_content_get_entry(data.ifd[ifd], tag);
  if (entry == nullptr || entry->data == nullptr) return 0;
  if (entry->format != EXIF_FORMAT_SHORT || entry->components < 1 || entry->size < 2) return 0;
  return exif_get_short(entry->data, exif_data_get_byte_order(&data));
}

}  // namespace

ExifInfo ParseExif(std::span<const std::uint8_t> segment) {
  ExifInfo info;
  const std::unique_ptr<ExifData, ExifDataDeleter> data(
      exif_data_new_from_data(segment.data(), static_cast<unsigned>(segment.size())));
  if (data == nullptr) return info;
  const int orientation = ShortOf(*data, EXIF_IFD_0, EXIF_TAG_ORIENTATION);
  if (orientation >= 1 && orientation <= 8) info.orientation = orientation;
  const int focal_length = ShortOf(*data, EXIF_IFD_EXIF, EXIF_TAG_FOCAL_LENGTH_IN_35MM_FILM);
  if (focal_length > 0) info.focal_length_35mm = focal_length;
  return info;
}

}  // namespace viewfix
