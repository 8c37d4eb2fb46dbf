#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "mcap/check.h"
#include "mcap/summary.h"

namespace taclink::mcap {

/// A chunk, while message indexes may follow it.
struct NewestChunk {
  using Entries = std::vector<std::pair<uint64_t, uint64_t>>;  ///< log time, offset in the chunk

  uint64_t offset = 0;
  std::map<uint16_t, Entries> messages;  ///< sorted
  std::set<uint16_t> indexed;
};

/// One pass of Check.
class Checker {
 public:
  Checker(const ByteSource& source, const Limits& limits) : source_(source), limits_(limits) {}
  Result<CheckReport> Run();

 private:
  void Add(Severity severity, uint64_t offset, std::string what);
  void Wrong(uint64_t offset, std::string what) { Add(Severity::kError, offset, std::move(what)); }
  void Doubt(uint64_t offset, std::string what) { Add(Severity::kWarning, offset, std::move(what)); }
  void CheckText(uint64_t offset, const std::string& text, const char* what);
  template <typename T>
  std::optional<T> Decoded(uint64_t offset, Bytes content);

  // Structure.
  bool CheckStart();
  bool Walk();
  void Visit(const RawRecord& record, uint64_t length);
  void VisitUnknown(Opcode opcode);
  void EndData(Bytes content);
  void CheckFooterOffset(uint64_t told, uint64_t found, const char* what);
  void CheckEnd(const Footer& footer);

  // Data section.
  void VisitData(const RawRecord& record, uint64_t length);
  void VisitSchema(uint64_t offset, Bytes content);
  void VisitChannel(uint64_t offset, Bytes content);
  std::optional<Message> VisitMessage(uint64_t offset, Bytes content);
  void VisitChunk(Bytes content, uint64_t length);
  void VisitChunkRecord(const RawRecord& record, uint64_t offset, ChunkIndex& index, uint64_t& messages);
  void VisitMessageIndex(Bytes content, uint64_t length);
  void EndNewestChunk();
  void VisitAttachment(Bytes content, uint64_t length);
  void VisitMetadata(Bytes content, uint64_t length);

  // Summary.
  void VisitSummary(const RawRecord& record, uint64_t length);
  void NoteGroup(Opcode opcode, uint64_t length);
  void VisitSummaryCopy(const RawRecord& record);
  void CheckStatistics();
  void CheckChunkIndexes();
  template <typename T>
  void CheckIndexes(const std::vector<T>& told, const std::vector<T>& found, const char* what);
  void CheckSummaryOffsets();
  void CheckSummary();

  const ByteSource& source_;
  const Limits limits_;
  CheckReport report_;
  uint64_t offset_ = 0;  // of the record that is visited
  Buffer record_;
  Buffer chunk_;
  bool in_summary_ = false;
  uint32_t data_crc_ = 0;
  uint64_t summary_start_ = 0;
  std::optional<uint64_t> summary_offset_start_;
  std::optional<NewestChunk> newest_chunk_;
  uint64_t loose_messages_ = 0;
  Summary found_;  // in the data section; its statistics are counted
  Summary told_;   // by the summary section
  uint64_t statistics_offset_ = 0;
  std::vector<SummaryOffset> groups_;  // of the summary section, as they are
  std::vector<SummaryOffset> told_groups_;
};

template <typename T>
std::optional<T> Checker::Decoded(uint64_t offset, Bytes content) {
  auto record = Decode<T>(content);
  if (record) return std::move(*record);
  Wrong(offset, record.error().message);
  return std::nullopt;
}

}  // namespace taclink::mcap
