/* SPDX-License-Identifier: BSD-3-Clause */
/* Localizes one image through the C interface:  example site.vfx image.pgm */
#include <stdio.h>
#include <stdlib.h>

#include "engine/viewfix.h"

int main(int argc, char** argv) {
  FILE* model_file = argc == 3 ? fopen(argv[1], "rb") : NULL;
  FILE* image_file = argc == 3 ? fopen(argv[2], "rb") : NULL;
  if (!model_file || !image_file) return fprintf(stderr, "usage: example MODEL IMAGE.pgm\n"), 2;

  fseek(model_file, 0, SEEK_END);
  const size_t size = (size_t)ftell(model_file);
  void* bytes = malloc(size);
  rewind(model_file);
  if (!bytes || fread(bytes, 1, size, model_file) != size) return perror(argv[1]), 1;

  int width = 0, height = 0;
  if (fscanf(image_file, "P5 %d %d 255", &width, &height) != 2) return perror(argv[2]), 1;
  fgetc(image_file);
  uint8_t* pixels = calloc((size_t)width, (size_t)height);
  if (!pixels || !fread(pixels, (size_t)width, (size_t)height, image_file)) return 1;

  char error[256];
  viewfix_localizer* localizer;
  if (viewfix_open(bytes, size, &localizer, error, sizeof error) != VIEWFIX_OK) {
    return fprintf(stderr, "%s: %s\n", argv[1], error), 1;
  }
  viewfix_fix fix = {.size = sizeof fix};
  const viewfix_status status =
      viewfix_localize(localizer, pixels, width, height, (size_t)width, &fix);
  if (status != VIEWFIX_OK) return fprintf(stderr, "%s\n", viewfix_status_name(status)), 1;
  if (fix.localized) printf("%s, %s (confidence %.2f)\n", fix.location, fix.view, fix.confidence);
  if (!fix.localized) printf("not localized\n");
  for (uint32_t bit = 1; bit != 0; bit <<= 1) {
    if (fix.reasons & bit) printf("reason: %s\n", viewfix_reason_name(bit));
  }
  viewfix_free(localizer);
  free(pixels);
  free(bytes);
  return fclose(image_file) | fclose(model_file);
}
