// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>

#include "tests/testing/jpeg_encoder.h"
#include "tests/testing/run_program.h"
#include "tests/testing/temp_folder.h"
#include "tests/testing/tiny_model.h"

namespace viewfix {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

std::string Pgm(const std::vector<std::uint8_t>& pixels) {
  std::string pgm = "P5\n200 150\n255\n";
  pgm.append(pixels.begin(), pixels.end());
  return pgm;
}

TEST(CApiExampleTest, SaysWhere) {
  const TempFolder folder;
  const std::string model = folder.Write("site.vfx", TinyModel());
  const std::string image = folder.Write("image.pgm", Pgm(MakeTexture(200, 150, 1)));
  const ProgramRun run = RunProgram({EXAMPLE, model, image});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, StartsWith("floor1/"));
}

TEST(CApiExampleTest, SaysWhyNot) {
  const TempFolder folder;
  const std::string model = folder.Write("site.vfx", TinyModel());
  const std::string image =
      folder.Write("image.pgm", Pgm(std::vector<std::uint8_t>(200 * 150, 128)));
  EXPECT_EQ(RunProgram({EXAMPLE, model, image}).out, "not localized\nreason: too_few_features\n");
}

TEST(CApiExampleTest, NamesADamagedModel) {
  const TempFolder folder;
  const std::string model =
      folder.Write("site.vfx", "not a model, and long enough to hold a header of one");
  const std::string image = folder.Write("image.pgm", Pgm(MakeTexture(200, 150, 1)));
  const ProgramRun run = RunProgram({EXAMPLE, model, image});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.err, HasSubstr("site.vfx: not a "));
}

}  // namespace
}  // namespace viewfix
