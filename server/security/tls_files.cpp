#include "server/security/tls_files.h"

#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include <memory>

#include "server/security/secret_file.h"

namespace taclink::server {
namespace {

template <auto kFree>
struct Freed {
  template <typename T>
  void operator()(T* object) const {
    kFree(object);
  }
};
using Bio = std::unique_ptr<BIO, Freed<BIO_free_all>>;
using Certificate = std::unique_ptr<X509, Freed<X509_free>>;
using Key = std::unique_ptr<EVP_PKEY, Freed<EVP_PKEY_free>>;

Bio MakeBio(const std::string& text) {
  return Bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}

Certificate FirstCertificate(const std::string& pem) {
  const Bio bio = MakeBio(pem);
  Certificate certificate(PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr));
  ERR_clear_error();
  return certificate;
}

// Never asks a terminal for a password.
int NoPassword(char*, int, int, void*) {
  return -1;
}

Key ReadKey(const std::string& pem) {
  const Bio bio = MakeBio(pem);
  Key key(PEM_read_bio_PrivateKey(bio.get(), nullptr, NoPassword, nullptr));
  ERR_clear_error();
  return key;
}

Error Invalid(std::string message) {
  return {ErrorCode::kInvalidArgument, std::move(message)};
}

}  // namespace

Result<TlsMaterial> ReadTlsFiles(const SecurityConfig& config) {
  auto certificate = ReadSecurityFile("security.certificate", config.certificate);
  if (!certificate) return certificate.error();
  auto key = ReadSecretFile("security.key", config.key);
  if (!key) return key.error();
  TlsMaterial out{.certificate = std::move(*certificate), .key = std::move(*key), .client_ca = {}};
  const Certificate own = FirstCertificate(out.certificate);
  if (!own)
    return Invalid("security.certificate " + config.certificate + " holds no certificate in PEM form");
  const Key own_key = ReadKey(out.key);
  if (!own_key)
    return Invalid("security.key " + config.key + " holds no private key in PEM form without a password");
  const bool match = X509_check_private_key(own.get(), own_key.get()) == 1;
  ERR_clear_error();
  if (!match)
    return Invalid("security.key " + config.key + " is not the key of the certificate " + config.certificate);
  if (config.client_ca.empty()) return out;
  auto client_ca = ReadSecurityFile("security.client_ca", config.client_ca);
  if (!client_ca) return client_ca.error();
  if (!FirstCertificate(*client_ca))
    return Invalid("security.client_ca " + config.client_ca + " holds no certificate in PEM form");
  out.client_ca = std::move(*client_ca);
  return out;
}

std::string TlsWarnings(const SecurityConfig& config, const TlsMaterial& material) {
  std::string out;
  const auto add = [&](const std::string& text) { out += (out.empty() ? "" : "; ") + text; };
  const Certificate own = FirstCertificate(material.certificate);
  if (own && X509_cmp_current_time(X509_get0_notAfter(own.get())) < 0)
    add("the certificate " + config.certificate + " has expired; clients will refuse it");
  if (own && X509_cmp_current_time(X509_get0_notBefore(own.get())) > 0)
    add("the certificate " + config.certificate + " is not valid yet; check the clock");
  return out;
}

}  // namespace taclink::server
