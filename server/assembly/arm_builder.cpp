#include "server/assembly/arm_builder.h"

#include <future>
#include <utility>
#include <vector>

#include "sensing/model/model_file.h"
#include "server/assembly/encoder.h"
#include "server/assembly/processor_factory.h"
#include "server/assembly/source_factory.h"

namespace taclink::server {
namespace {

Result<LinkParts> BuildLink(const LinkConfig& link, Clock& clock) {
  auto model = LoadLinkModel(link.model);
  if (!model) return model.error();
  auto source = MakeSource(link, *model, clock);
  if (!source) return source.error();
  auto processor = MakeProcessor(link, *model);
  if (!processor) return processor.error();
  return LinkParts{.description = {.name = link.name,
                                   .model = std::move(*model),
                                   .base_from_link = link.BaseFromLink(),
                                   .source = static_cast<SourceKind>(link.source.index())},
                   .source = std::move(*source),
                   .processor = std::move(*processor)};
}

}  // namespace

Result<std::unique_ptr<Arm>> BuildArm(const Config& config, Clock& clock) {
  std::vector<LinkParts> links;
  std::vector<std::string> names;
  // Simulated links solve their scenes first.
  std::vector<std::future<Result<LinkParts>>> built;
  for (const LinkConfig& link : config.links)
    built.push_back(std::async(std::launch::async, [&link, &clock] { return BuildLink(link, clock); }));
  for (size_t i = 0; i < built.size(); ++i) {
    const LinkConfig& link = config.links[i];
    auto parts = built[i].get();
    if (!parts) return Error{parts.error().code, "link '" + link.name + "': " + parts.error().message};
    links.push_back(std::move(*parts));
    names.push_back(link.name);
  }
  return std::make_unique<Arm>(config.arm_name, std::move(links), MakeEncoder(names), clock);
}

}  // namespace taclink::server
