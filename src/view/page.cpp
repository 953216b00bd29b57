#include "view/page.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "view/assets.hpp"
#include "view/encode.hpp"
#include "view/lab.hpp"

namespace pendula::view {

KeptRows::KeptRows(std::size_t width, std::size_t most) : width_(width), most_(std::max<std::size_t>(most, 3)) {}

void KeptRows::add(std::span<const double> row) {
  if (seen_ % stride_ == 0) {
    if (regular() + 1 >= most_) halve();  // one place is kept for the last row
    if (seen_ % stride_ == 0) rows_.insert(rows_.end(), row.begin(), row.end());
  }
  last_.assign(row.begin(), row.end());
  ++seen_;
}

std::span<const double> KeptRows::operator[](std::size_t i) const {
  if (i == regular()) return last_;
  return {rows_.data() + i * width_, width_};
}

void KeptRows::halve() {
  const std::size_t kept = (regular() + 1) / 2;
  for (std::size_t i = 1; i < kept; ++i) {
    const auto from = rows_.begin() + static_cast<std::ptrdiff_t>(2 * i * width_);
    std::copy_n(from, width_, rows_.begin() + static_cast<std::ptrdiff_t>(i * width_));
  }
  rows_.resize(kept * width_);
  stride_ *= 2;
}

namespace {

using nlohmann::json;

constexpr std::size_t enough_rows = 2048;                  // of exact ones
constexpr std::size_t fewest_rows = 512;                   // before a page may grow
constexpr std::size_t most_marks = 1000;                   // of an event in a run
constexpr double alike = 1e-6;                             // steps that differ by less are of one size
constexpr double least_wanted = 2000, most_wanted = 4000;  // rows of runs that are not very long

/// Bytes of a row in base64: the time, the numbers, and three floats: energy error, distance and step size.
std::size_t row_bytes(std::size_t numbers, std::size_t size) {
  return (8 + numbers * size + 12) * 4 / 3 + 1;
}

/// All columns but the time.
std::vector<std::size_t> all_columns(const Scene& scene) {
  std::vector<std::size_t> columns(std::max<std::size_t>(scene.columns.size(), 1) - 1);
  std::iota(columns.begin(), columns.end(), std::size_t{1});
  return columns;
}

/// The columns that a drawing needs: without points where they follow from angles.
std::vector<std::size_t> drawn_columns(const Scene& scene) {
  std::vector<std::size_t> columns;
  for (const Coordinate& coordinate : scene.coordinates) {
    columns.push_back(coordinate.column);
    columns.push_back(coordinate.rate_column);
  }
  for (const ActingInput& input : scene.inputs) columns.push_back(input.column);
  for (const Point& point : scene.lengths.empty() ? scene.points : std::vector<Point>()) {
    for (int axis = 0; axis < point.components; ++axis) {
      columns.push_back(point.column + static_cast<std::size_t>(axis));
    }
  }
  return columns;
}

const char* name_of(Rods rods) {
  switch (rods) {
    case Rods::in_order:
      return "in order";
    case Rods::rigid:
      return "rigid";
    case Rods::none:
      break;
  }
  return "none";
}

}  // namespace

Page::Page(const std::string& file, Scene scene, std::size_t runs, const PageLimits& limits)
    : scene_(std::move(scene)),
      limits_(limits),
      expected_(std::max<std::size_t>(runs, 1)),
      all_columns_(all_columns(scene_)),
      drawn_columns_(drawn_columns(scene_)),
      file_(file) {}

// Times of later runs are among those of the first, to the last bit: their interval is twice, four times, … as long.
RowTimes Page::times(double duration, std::size_t run) const {
  if (duration == 0) return {1, {}};
  const auto most = [&](std::size_t k) { return static_cast<double>(most_rows(k) - 2); };  // the ends, without thinning
  const double wanted = std::max({least_wanted, std::min(most_wanted, 400 * duration), 50 * duration});
  double interval = duration / std::min(std::ceil(wanted), most(0));
  while (run > 0 && duration / interval > most(run)) interval *= 2;
  return {interval, {}};
}

void Page::begin_run(const std::string& label) {
  if (!runs_.empty() && runs_.back().rows.size() == 0) runs_.pop_back();
  const std::size_t run = runs_.size();
  runs_.push_back({label, KeptRows(scene_.columns.size() + 1, most_rows(run)), share_of(run), {}, {}});
}

void Page::take(const Row& row) {
  add_row(row.numbers, row.step > 0 ? row.step : std::numeric_limits<double>::quiet_NaN());
}

void Page::happen(const EventRow& happened) {
  add_event(happened.event.name, happened.row.motion.time, happened.up);
}

void Page::add_event(const std::string& name, double time, bool up) {
  if (runs_.empty()) throw std::logic_error("page: expected begin_run before an event");
  runs_.back().events.try_emplace(name, 2, most_marks).first->second.add(std::array{time, up ? 1.0 : 0.0});
}

void Page::add_row(std::span<const double> row, double step) {
  if (runs_.empty()) throw std::logic_error("page: expected begin_run before a row");
  if (row.size() != scene_.columns.size()) {
    throw std::invalid_argument("page: expected a row of " + std::to_string(scene_.columns.size()) + " numbers, got " +
                                std::to_string(row.size()));
  }
  row_.assign(row.begin(), row.end());
  row_.push_back(step);
  runs_.back().rows.add(row_);
}

void Page::end_run(const EnergyError& energy) {
  if (!runs_.empty()) runs_.back().energy = energy;
}

void Page::close() {
  if (!runs_.empty() && runs_.back().rows.size() == 0) runs_.pop_back();
  if (!runs_.empty()) file_.write(text());
}

// The first run has half of the page, the others the rest.
std::size_t Page::share_of(std::size_t run) const {
  if (expected_ == 1) return limits_.rows;
  return run == 0 ? limits_.rows / 2 : limits_.rows / 2 / (expected_ - 1);
}

std::size_t Page::most_rows(std::size_t run) const {
  const std::size_t exact = share_of(run) / row_bytes(all_columns_.size(), sizeof(double));
  if (exact >= enough_rows && run == 0) return exact;
  const std::size_t drawn = row_bytes(drawn_columns_.size(), sizeof(float));
  return std::max({share_of(run) / drawn, std::min(fewest_rows, limits_.long_rows / expected_ / drawn), exact});
}

bool Page::is_exact(const Run& run) const {
  return &run == runs_.data() && run.rows.size() * row_bytes(all_columns_.size(), sizeof(double)) <= run.share;
}

const std::vector<std::size_t>& Page::columns_of(const Run& run) const {
  return is_exact(run) ? all_columns_ : drawn_columns_;
}

std::vector<float> Page::energy_errors(const Run& run) const {
  const auto found = std::find(scene_.columns.begin(), scene_.columns.end(), "energy");
  if (found == scene_.columns.end() || std::isnan(run.energy.initial)) return {};
  const auto column = static_cast<std::size_t>(found - scene_.columns.begin());
  std::vector<float> errors;
  errors.reserve(run.rows.size());
  for (std::size_t i = 0; i < run.rows.size(); ++i) {
    errors.push_back(static_cast<float>(run.energy.of(run.rows[i][column])));
  }
  return errors;
}

// Distances from the first run at rows of equal times, computed from doubles.
std::vector<float> Page::separations(const Run& run) const {
  const KeptRows& first = runs_.front().rows;
  std::vector<float> separations;
  if (&run == runs_.data()) return separations;
  separations.reserve(run.rows.size());
  std::size_t k = 0;
  for (std::size_t i = 0; i < run.rows.size(); ++i) {
    const std::span<const double> row = run.rows[i];
    while (k + 1 < first.size() && first[k][0] < row[0]) ++k;
    const bool together = first[k][0] == row[0];
    separations.push_back(together ? static_cast<float>(distance(first[k], row))
                                   : std::numeric_limits<float>::quiet_NaN());
  }
  return separations;
}

// Step sizes of the rows; empty if all are equal, except the last one, which may be cut short.
std::vector<float> Page::steps(const Run& run) const {
  std::vector<float> steps;
  steps.reserve(run.rows.size());
  double least = std::numeric_limits<double>::infinity(), largest = 0;
  for (std::size_t i = 0; i < run.rows.size(); ++i) {
    const double step = run.rows[i].back();
    steps.push_back(static_cast<float>(step));
    if (std::isnan(step) || i + 1 == run.rows.size()) continue;
    least = std::min(least, step);
    largest = std::max(largest, step);
  }
  if (largest <= least * (1 + alike)) steps.clear();
  return steps;
}

// The largest distance of any point, or of any coordinate if there are no points.
double Page::distance(std::span<const double> a, std::span<const double> b) const {
  double largest = 0;
  for (const Point& point : scene_.points) {
    double square = 0;
    for (std::size_t k = point.column; k < point.column + static_cast<std::size_t>(point.components); ++k) {
      square += (a[k] - b[k]) * (a[k] - b[k]);
    }
    largest = std::max(largest, std::sqrt(square));
  }
  if (!scene_.points.empty()) return largest;
  for (const Coordinate& coordinate : scene_.coordinates) {
    largest = std::max(largest, std::abs(a[coordinate.column] - b[coordinate.column]));
  }
  return largest;
}

// Encodes times, columns one after the other, energy errors, distances, step sizes.
std::string Page::encoded(const Run& run) const {
  Bytes bytes;
  const std::size_t rows = run.rows.size();
  for (std::size_t i = 0; i < rows; ++i) bytes.add(run.rows[i][0]);
  const bool exact = is_exact(run);
  for (const std::size_t column : columns_of(run)) {
    for (std::size_t i = 0; i < rows; ++i) {
      const double number = run.rows[i][column];
      if (exact) {
        bytes.add(number);
      } else {
        bytes.add(static_cast<float>(number));
      }
    }
  }
  for (const float error : energy_errors(run)) bytes.add(error);
  for (const float distance : separations(run)) bytes.add(distance);
  for (const float step : steps(run)) bytes.add(step);
  std::string text;
  append_base64(text, bytes.view());
  return text;
}

json Page::described(const Run& run) const {
  json events = json::array();
  for (const auto& [name, marks] : run.events) {
    json times = json::array(), up = json::array();
    for (std::size_t i = 0; i < marks.size(); ++i) {
      times.push_back(marks[i][0]);
      up.push_back(marks[i][1] != 0);
    }
    events.push_back(
        {{"name", name}, {"count", marks.seen()}, {"stride", marks.stride()}, {"times", times}, {"up", up}});
  }
  return {{"label", run.label},
          {"rows", run.rows.size()},
          {"seen", run.rows.seen()},
          {"stride", run.rows.stride()},
          {"exact", is_exact(run)},
          {"columns", columns_of(run)},
          {"energy", !energy_errors(run).empty()},
          {"separation", &run != runs_.data()},
          {"steps", !steps(run).empty()},
          {"events", events}};
}

json Page::described() const {
  json coordinates = json::array(), inputs = json::array(), points = json::array(), runs = json::array(),
       connections = json::array();
  for (const Coordinate& each : scene_.coordinates) {
    coordinates.push_back({each.name, each.unit, each.is_angle, each.column, each.rate_column});
  }
  for (const ActingInput& each : scene_.inputs) inputs.push_back({each.name, each.unit, each.column});
  for (const Point& each : scene_.points) {
    points.push_back({each.name, each.column, each.components, each.mass, each.kind});
  }
  for (const Connection& each : scene_.connections) connections.push_back({each.kind, each.from, each.to});
  for (const Run& run : runs_) runs.push_back(described(run));
  return {{"title", scene_.title},
          {"subject", scene_.subject},
          {"scenario", scene_.scenario},
          {"version", scene_.version},
          {"columns", scene_.columns},
          {"dimension", scene_.dimension()},
          {"coordinates", coordinates},
          {"inputs", inputs},
          {"points", points},
          {"connections", connections},
          {"rods", name_of(scene_.rods)},
          {"lengths", scene_.lengths},
          {"timeUnit", scene_.time_unit},
          {"lengthUnit", scene_.length_unit},
          {"loaded", scene_.loaded},
          {"laboratory", scene_.laboratory},
          {"runs", runs}};
}

/// The text in place of {{name}}.
std::string Page::part(const std::string& name) const {
  if (name == "title") return html_text(scene_.title);
  if (name == "version") return html_text(scene_.version);
  if (name == "style") return std::string(assets::style);
  if (name == "scene") return script_json(described());
  if (name == "script") {
    const int dimension = scene_.dimension();
    const std::string_view stage = dimension == 3   ? assets::script_space
                                   : dimension == 2 ? assets::script_plane
                                                    : assets::script_lanes;
    return std::string(assets::script_before) + std::string(stage) + std::string(assets::script_after);
  }
  std::string text;
  if (name == "runs") {
    for (const Run& run : runs_) text += "<script type=\"text/plain\" class=\"run\">" + encoded(run) + "</script>\n";
  } else if (name == "laboratory" && !scene_.laboratory.empty()) {
    json start = scene_.laboratory_model.empty() ? json::object() : json::parse(scene_.laboratory_model);
    start["title"] = scene_.title;
    text = "<script type=\"application/json\" id=\"laboratory\">" + script_json(lab_page(start)) + "</script>";
  }
  return text;
}

std::string Page::text() const {
  return filled(assets::page, [this](const std::string& name) { return part(name); });
}

}  // namespace pendula::view
