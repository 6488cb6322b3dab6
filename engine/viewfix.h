/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef VIEWFIX_ENGINE_VIEWFIX_H_
#define VIEWFIX_ENGINE_VIEWFIX_H_

/* The C interface of the localization engine: where was this image taken?
 *
 * The engine opens no file, starts no thread, reads no clock and prints nothing: the caller
 * brings the model's bytes and the pixels. viewfix_open() checks and allocates everything,
 * viewfix_localize() allocates nothing and gives the same answer on every processor.
 *
 * Threads: one localizer serves one thread at a time; any number of localizers may share one
 * model's bytes. Errors: a viewfix_status; no function ends the program or throws. */

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Values are part of the interface: they do not change. */
typedef enum viewfix_status {
  VIEWFIX_OK = 0,
  VIEWFIX_INVALID_ARGUMENT = 1,   /* a null pointer, an empty image, a side over 16384 pixels */
  VIEWFIX_CORRUPT = 2,            /* not a model, truncated, or a bit of it changed */
  VIEWFIX_UNSUPPORTED = 3,        /* a newer model, or features that this build lacks */
  VIEWFIX_RESOURCE_EXHAUSTED = 4, /* no memory */
  VIEWFIX_INTERNAL = 5            /* a fault of the engine itself */
} viewfix_status;

/* Bits of viewfix_fix.reasons: why a frame was not localized, or why its fix is doubtful. */
enum {
  VIEWFIX_TOO_FEW_FEATURES = 1 << 0,
  VIEWFIX_UNKNOWN_PLACE = 1 << 1,
  VIEWFIX_AMBIGUOUS = 1 << 2,
  VIEWFIX_LOW_INLIERS = 1 << 3,
  VIEWFIX_BLURRED = 1 << 4, /* of the image: what may have kept it from being localized */
  VIEWFIX_DARK = 1 << 5,
  VIEWFIX_OVEREXPOSED = 1 << 6
};

/* An opened model and the memory to localize with it. */
typedef struct viewfix_localizer viewfix_localizer;

/* Where an image was taken. Fields are only ever added, at the end. */
typedef struct viewfix_fix {
  size_t size;               /* in: sizeof(viewfix_fix); fields beyond it are not written */
  int32_t localized;         /* 1: the answer below holds; 0: not known, and `reasons` says why */
  uint32_t reasons;          /* bits, see above */
  const char* location;      /* UTF-8, parts between slashes; null unless localized. Lives as
                                long as the localizer */
  const char* view;          /* the same; null also where `level` is less than the name's parts */
  float confidence;          /* 0..1, probability that the location is right */
  float score;               /* of the best (location, view), eq. (5) of the method */
  float margin;              /* best location's score less the best other location's */
  int32_t keyframe_id;       /* nearest training image of the location and view; -1: none */
  int32_t keyframe_has_pose; /* 1: keyframe_pose holds its pose */
  float keyframe_pose[7];    /* world_from_cam: tx ty tz, qx qy qz qw; camera x right, y down, z
                                forward; metres if the model is metric, else its own unit */
  int32_t pose_valid;        /* 1: a pose of this very image was computed; the rest holds it */
  int32_t pose_map;          /* maps of one model have frames of reference of their own */
  double pose[7];            /* as keyframe_pose */
  float covariance[21];      /* upper triangle, row by row, of [t; left rotation vector, radians] */
  int32_t inliers;           /* landmarks that agree with the pose */
  int32_t level;      /* parts of the location's name that are certain and said: 1 of "floor10"
                         where "floor10/lobby" and "floor10/lift" look alike; 0: not localized */
  int32_t num_rivals; /* locations that it may be as well, best first; where it is ambiguous,
                         the best guess of all is the first */
  const char* rivals[5];
} viewfix_fix;

/* "0.1.0" */
const char* viewfix_version(void);

/* "ok", "corrupt", ...; static. */
const char* viewfix_status_name(viewfix_status status);

/* "too_few_features", ... of one bit of reasons; static; "" for bits that are not defined. */
const char* viewfix_reason_name(uint32_t reason);

/* Opens a model. `bytes` are borrowed: they start at an address that is a multiple of 8 (as
 * malloc gives) and stay unchanged until viewfix_free(). On success *out is to be freed by the
 * caller; otherwise it is null and `error` (which may be null) holds one line of at most
 * error_size bytes, its end mark included, that says what is wrong. Any bytes may be given:
 * the reader trusts none of them. */
viewfix_status viewfix_open(const void* bytes, size_t size, viewfix_localizer** out, char* error,
                            size_t error_size);

/* Localizes one image of width x height 8-bit grey pixels, rows row_bytes apart. `fix->size`
 * must be set. Not knowing where is VIEWFIX_OK with fix->localized == 0. After an error the
 * rest of *fix is as it was. */
viewfix_status viewfix_localize(viewfix_localizer* localizer, const uint8_t* pixels, int32_t width,
                                int32_t height, size_t row_bytes, viewfix_fix* fix);

/* An image with its colours, as cameras and JPEG have them: Y, Cb and Cr of BT.601 in full range
 * (neutral chroma is 128). Models that were trained with colours know places better by them, those
 * with a map tell look-alike places apart; others take no notice. */
typedef struct viewfix_image {
  size_t size;      /* in: sizeof(viewfix_image); fields are only ever added, at the end */
  const uint8_t* y; /* width x height bytes, rows row_bytes apart */
  int32_t width;
  int32_t height;
  size_t row_bytes;
  const uint8_t* cb; /* null, both: the colours are not known */
  const uint8_t* cr;
  int32_t chroma_width; /* of both planes, which cover the whole image: half of its mostly */
  int32_t chroma_height;
  size_t chroma_row_bytes;
} viewfix_image;

/* The same as viewfix_localize(). */
viewfix_status viewfix_localize_image(viewfix_localizer* localizer, const viewfix_image* image,
                                      viewfix_fix* fix);

/* Null is allowed. */
void viewfix_free(viewfix_localizer* localizer);

#ifdef __cplusplus
} /* extern "C" */
#endif

#endif /* VIEWFIX_ENGINE_VIEWFIX_H_ */
