#include "view/page.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <pendula/run/chain_subject.hpp>
#include <pendula/run/row_times.hpp>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "io/errors.hpp"
#include "io/files.hpp"
#include "io/trajectory.hpp"
#include "view/encode.hpp"
#include "view/scene.hpp"

namespace pendula::view {
namespace {

namespace fs = std::filesystem;

/// A folder of its own for each test, gone when the test is over.
class PageTest : public testing::Test {
 protected:
  PageTest() : folder_(fs::temp_directory_path() / ("pendula_page_" + std::to_string(std::random_device()()))) {
    fs::create_directory(folder_);
  }
  ~PageTest() override {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }

  std::string file(const std::string& name = "out.html") const { return folder_ / name; }
  std::size_t files() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }
  static std::string text_of(const std::string& file) {
    std::ifstream stream(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }

 private:
  fs::path folder_;
};

template <class Space>
Scene chain_scene(int links) {
  ChainParameters<Space> parameters;
  parameters.masses = parameters.lengths = Eigen::VectorXd::Ones(links);
  Scene scene = scene_of(ChainSubject<Space>(Chain<Space>(parameters)));
  scene.title = "a chain";
  return scene;
}

/// Adds rows 0, 1, …: the time, and numbers that differ.
void add_rows(Page& page, const Scene& scene, int rows) {
  std::vector<double> row(scene.columns.size());
  for (int i = 0; i < rows; ++i) {
    for (std::size_t k = 0; k < row.size(); ++k) row[k] = std::sin(0.1 * i + static_cast<double>(k));
    row[0] = i;
    page.add_row(row);
  }
}

/// What the page says of itself.
nlohmann::json description(const std::string& html) {
  const std::string open = "<script type=\"application/json\" id=\"scene\">";
  const std::size_t begin = html.find(open) + open.size();
  return nlohmann::json::parse(html.substr(begin, html.find("</script>", begin) - begin));
}

std::string page_of(const std::string& file, const Scene& scene, int rows, int runs = 1) {
  Page page(file, scene, static_cast<std::size_t>(runs));
  for (int run = 0; run < runs; ++run) {
    page.begin_run("run " + std::to_string(run));
    add_rows(page, scene, rows);
    page.end_run({0, 1, 0});
  }
  page.close();
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

TEST(KeptRows, FirstAndLastStayAndTheOthersAreEven) {
  for (const int count : {1, 2, 3, 7, 8, 9, 10, 100, 1000, 1025}) {
    KeptRows rows(2, 8);
    for (int i = 0; i < count; ++i) rows.add(std::vector<double>{double(i), -double(i)});
    ASSERT_LE(rows.size(), 8u);
    EXPECT_EQ(rows.seen(), count);
    EXPECT_EQ(rows[0][0], 0);
    EXPECT_EQ(rows[rows.size() - 1][0], count - 1) << count;
    EXPECT_EQ(rows[rows.size() - 1][1], 1 - count);
    for (std::size_t i = 0; i + 1 < rows.size(); ++i) {
      EXPECT_EQ(rows[i][0], static_cast<double>(i) * static_cast<double>(rows.stride()));
    }
  }
}

TEST(KeptRows, NothingIsThinnedBelowTheLimit) {
  KeptRows rows(1, 100);
  for (int i = 0; i < 99; ++i) rows.add(std::vector<double>{double(i)});
  EXPECT_EQ(rows.size(), 99u);
  EXPECT_EQ(rows.stride(), 1);
}

TEST(Encode, Base64IsThatOfTheStandard) {  // RFC 4648, section 10
  const auto base64 = [](std::string_view bytes) {
    std::string text;
    append_base64(text, bytes);
    return text;
  };
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
  EXPECT_EQ(base64("\xff\xfe\xfd"), "//79");
}

TEST(Encode, NumbersHaveTheirLowestByteFirst) {
  Bytes bytes;
  bytes.add(1.0);
  bytes.add(-2.0F);
  EXPECT_EQ(bytes.view(), std::string_view("\0\0\0\0\0\0\xf0\x3f\0\0\0\xc0", 12));
}

TEST(Encode, TextCannotLeaveItsPlace) {
  EXPECT_EQ(html_text("a < b & \"c\" > \xff"), "a &lt; b &amp; &quot;c&quot; &gt; \xEF\xBF\xBD");
  EXPECT_EQ(script_json("</script><!--\xff"), "\"\\u003c/script>\\u003c!--\xEF\xBF\xBD\"");
}

TEST_F(PageTest, EventsAreCountedAndTheirMarksThinned) {
  const Scene scene = chain_scene<Planar>(1);
  const std::string html = file();
  Page page(html, scene);
  EXPECT_THROW(page.add_event("early", 0, true), std::logic_error);
  page.begin_run("");
  add_rows(page, scene, 3);
  for (int k = 0; k < 2500; ++k) page.add_event("often", 1e-3 * k, k % 2 == 0);
  page.add_event("once", 0.5, false);
  page.close();
  const nlohmann::json events = description(text_of(html))["runs"][0]["events"];
  ASSERT_EQ(events.size(), 2u);
  EXPECT_EQ(events[1],
            (nlohmann::json{{"name", "once"}, {"count", 1}, {"stride", 1}, {"times", {0.5}}, {"up", {false}}}));
  EXPECT_EQ(events[0]["count"], 2500);
  EXPECT_EQ(events[0]["stride"], 4);
  EXPECT_EQ(events[0]["times"].size(), 626u);
  EXPECT_EQ(events[0]["times"][1], 4e-3);
  EXPECT_EQ(events[0]["times"].back(), 2.499);
}

TEST_F(PageTest, StepsAreThereWhereTheyDiffer) {
  const Scene scene = chain_scene<Planar>(1);
  for (const bool differ : {false, true}) {
    const std::string html = file();
    Page page(html, scene);
    page.begin_run("");
    const std::vector<double> row(scene.columns.size());
    page.add_row(row);
    for (int k = 0; k < 5; ++k) page.add_row(row, differ ? 0.1 + 0.01 * k : 0.1);
    page.add_row(row, 0.05);  // the last one is cut short
    page.close();
    EXPECT_EQ(description(text_of(html))["runs"][0]["steps"], differ);
  }
}

TEST_F(PageTest, HoldsTextsThatLookLikeTags) {
  Scene scene = chain_scene<Planar>(1);
  scene.title = scene.scenario = scene.version = "</script></title><b onclick=x>{{scene}}";
  const std::string html = page_of(file(), scene, 3);
  EXPECT_EQ(html.find("</script></title>"), std::string::npos);
  EXPECT_EQ(html.find("<b onclick"), std::string::npos);
  EXPECT_EQ(description(html)["scenario"], scene.scenario);
}

TEST_F(PageTest, KeepsAThousandRowsAsTheyAre) {
  const std::string html = page_of(file(), chain_scene<Spatial>(4), 1001);
  const nlohmann::json run = description(html)["runs"][0];
  EXPECT_EQ(run["rows"], 1001);
  EXPECT_EQ(run["stride"], 1);
  EXPECT_EQ(run["exact"], true);
  EXPECT_LE(html.size(), 1'500'000u);  // measured 423,435, most of it 320,000 of rows
}

TEST_F(PageTest, ThinsLongRuns) {
  const Scene scene = chain_scene<Spatial>(4);
  const std::string html = page_of(file(), scene, 100'000);
  const nlohmann::json run = description(html)["runs"][0];
  EXPECT_EQ(run["seen"], 100'000);
  EXPECT_EQ(run["stride"], 32);
  EXPECT_EQ(run["rows"], 3126);        // 0, 32, …, 99968, and 99999
  EXPECT_LE(html.size(), 1'500'000u);  // measured 1,114,770
}

// So many that motion is even, so few that none is thinned away; those of later runs are among those of the first.
TEST_F(PageTest, WantsRowsAtTimesThatItCanKeep) {
  for (const int links : {1, 3, 100}) {
    for (const std::size_t runs : {1U, 3U, 50U}) {
      const Scene scene = chain_scene<Spatial>(links);
      for (const double duration : {1e-9, 7.3, 1000.0}) {
        Page page(file(), scene, runs);
        const double first = page.times(duration).interval, later = page.times(duration, 1).interval;
        EXPECT_GT(duration / first, 100) << links << ' ' << runs << ' ' << duration;
        EXPECT_LE(duration / first, 10000);
        EXPECT_EQ(std::exp2(std::round(std::log2(later / first))), later / first);
        for (std::size_t run = 0; run < runs; ++run) {
          page.begin_run("");
          const RowTimes times = page.times(duration, run);
          std::vector<double> row(scene.columns.size());
          for (std::int64_t k = 0; !is_reached(duration, row[0] = times.at(k)); ++k) page.add_row(row);
          row[0] = duration;  // as a run does, once
          page.add_row(row);
        }
        page.close();
        const nlohmann::json told = description(text_of(file()));
        for (const nlohmann::json& run : told["runs"]) {
          EXPECT_EQ(run["stride"], 1) << links << ' ' << runs << ' ' << duration;
        }
      }
    }
  }
  EXPECT_EQ(Page(file(), chain_scene<Planar>(1)).times(0).at(1), 1);  // a run of one row
  EXPECT_EQ(Page(file(), chain_scene<Planar>(2)).times(10).interval, 0.0025);
}

TEST_F(PageTest, LongRowsAreFloatsOfWhatIsDrawn) {
  const std::string html = page_of(file(), chain_scene<Planar>(1000), 400);
  const nlohmann::json run = description(html)["runs"][0];
  EXPECT_EQ(run["rows"], 400);
  EXPECT_EQ(run["exact"], false);
  EXPECT_EQ(run["columns"].size(), 2000u);  // angles and rates: where the bobs are follows from them
  EXPECT_LE(html.size(), 7'000'000u);       // measured 4,477,747
}

TEST_F(PageTest, FiftyRunsShareThePage) {
  const std::string html = page_of(file(), chain_scene<Planar>(2), 1001, 50);
  const nlohmann::json runs = description(html)["runs"];
  ASSERT_EQ(runs.size(), 50u);
  EXPECT_EQ(runs[0]["exact"], true);
  EXPECT_EQ(runs[49]["label"], "run 49");
  EXPECT_EQ(runs[49]["separation"], true);
  EXPECT_LE(html.size(), 1'500'000u);  // measured 1,254,717
}

TEST_F(PageTest, RunsWithoutRowsAreLeftOut) {
  const Scene scene = chain_scene<Planar>(1);
  {
    Page page(file(), scene, 2);
    page.begin_run("empty");
    page.begin_run("full");
    add_rows(page, scene, 2);
    page.close();
  }
  EXPECT_EQ(description(text_of(file()))["runs"].size(), 1u);
  EXPECT_EQ(description(text_of(file()))["runs"][0]["energy"], false);  // nobody said what they are compared with
}

TEST_F(PageTest, WithoutRowsThereIsNoFile) {
  {
    Page page(file(), chain_scene<Planar>(1));
    page.begin_run("empty");
    page.close();
  }
  EXPECT_EQ(files(), 0u);
}

TEST_F(PageTest, ARowOfAnotherLengthIsAMistake) {
  Page page(file(), chain_scene<Planar>(1));
  page.begin_run("");
  EXPECT_THROW(page.add_row(std::vector<double>(3)), std::invalid_argument);
}

TEST_F(PageTest, AnOldPageStaysUntilTheNewOneIsThere) {
  const std::string old = page_of(file(), chain_scene<Planar>(1), 3);
  {
    Page page(file(), chain_scene<Planar>(2));
    page.begin_run("");
    add_rows(page, chain_scene<Planar>(2), 3);
    EXPECT_EQ(text_of(file()), old);
  }
  EXPECT_EQ(text_of(file()), old);  // the run ended without a page
  EXPECT_EQ(files(), 1u);
}

TEST_F(PageTest, LinksAreFollowed) {
  fs::create_symlink(file(), file("link.html"));
  page_of(file("link.html"), chain_scene<Planar>(1), 3);
  EXPECT_TRUE(fs::is_symlink(file("link.html")));
  EXPECT_TRUE(fs::is_regular_file(fs::symlink_status(file())));
}

TEST_F(PageTest, AFileThatCannotBeOpenedIsAnInputError) {
  const auto message = [](const std::string& name) -> std::string {
    try {
      io::WholeFile file(name);
      return "no error";
    } catch (const io::InputError& error) {
      return error.what();
    }
  };
  EXPECT_EQ(message("no/such/folder/out.html"),
            "no/such/folder/out.html: expected a file that can be written, got: no/such/folder/ does not exist");
  EXPECT_EQ(message(file("")), file("") + ": expected a file that can be written, got: Is a directory");
}

#ifdef __linux__
TEST_F(PageTest, AFullDiskIsAnOutputError) {
  Page page("/dev/full", chain_scene<Planar>(1));
  page.begin_run("");
  add_rows(page, chain_scene<Planar>(1), 3);
  try {
    page.close();
    FAIL() << "no error";
  } catch (const io::OutputError& error) {
    EXPECT_STREQ(error.what(), "/dev/full: could not be written: No space left on device");
  }
}
#endif

}  // namespace
}  // namespace pendula::view
